"""Navigators that only propagate: ``truth`` from the true state, ``dead-reckoning`` from the start."""

from __future__ import annotations

from abc import abstractmethod

from posse_core._dynamics.plan import Burn
from posse_core._errors import ComponentError
from posse_core._interfaces.navigator import Estimate, Innovation, NavigationProblem, Navigator, Readings
from posse_core._navigation.belief import Belief, Propagation
from posse_core._navigation.options import DynamicsOptions


class CoastingNavigator(Navigator[DynamicsOptions]):
    """Propagates what it knows through the impulses."""

    def start(self, problem: NavigationProblem) -> None:
        self._propagation = Propagation(problem, self.options)
        self._burns: list[Burn] = []
        self._known: Belief | None = None

    def burned(self, burn: Burn) -> None:
        self._burns.append(burn)

    def update(self, readings: Readings) -> Innovation | None:
        self._known = self.known(readings) or self._known
        return None

    def estimate(self, t_s: float) -> Estimate | None:
        if self._known is None:
            return None
        later = self._propagation.later(self._known, t_s, self._burns, with_last=True)
        return later.estimate()

    @abstractmethod
    def known(self, readings: Readings) -> Belief | None:
        """What the readings say to this navigator; None for nothing new."""


class TruthNavigator(CoastingNavigator):
    """Returns the true state, propagated from the last frame. For comparison with others."""

    def known(self, readings: Readings) -> Belief | None:
        if readings.truth is None:
            raise ComponentError("navigator 'truth' was given readings without the true state")
        return self._propagation.belief(readings.truth)


class DeadReckoningNavigator(CoastingNavigator):
    """Propagates the planned motion through the commanded impulses, and reads nothing."""

    def start(self, problem: NavigationProblem) -> None:
        super().start(problem)
        self._known = self._propagation.belief(problem.start)

    def known(self, readings: Readings) -> Belief | None:
        return None
