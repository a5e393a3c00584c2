"""The navigators ``ekf`` and ``ukf``: a bank of Kalman filters that live at the instant of the last
reading."""

from __future__ import annotations

import math
from typing import ClassVar

from posse_core._dynamics.plan import Burn
from posse_core._interfaces.navigator import Estimate, Innovation, NavigationProblem, Navigator, Readings
from posse_core._navigation.belief import Belief, Propagation
from posse_core._navigation.filter import Filter
from posse_core._navigation.hypotheses import Bank
from posse_core._navigation.kinematics import has_attitude
from posse_core._navigation.linearisation import Linearisation, SigmaPoints, Tangents
from posse_core._navigation.options import KalmanOptions


class KalmanNavigator(Navigator[KalmanOptions]):
    """Estimates relative motion, attitude and rate from keypoints, poses, lines of sight and ranges."""

    linearisation: ClassVar[Linearisation]

    def start(self, problem: NavigationProblem) -> None:
        rate_rad_s = math.radians(self.options.rate_deg_s)
        self._propagation = Propagation(problem, self.options, rate_rad_s, self.linearisation)
        first = self._propagation.belief(problem.start)
        self._bank = Bank(problem, self.options, Filter(self.linearisation, self.options), first)
        self._burns: list[Burn] = []

    def burned(self, burn: Burn) -> None:
        self._burns.append(burn)

    def update(self, readings: Readings) -> Innovation | None:
        self._bank.replace(
            [self._at(h.belief, readings.t_s, with_last=False) for h in self._bank.hypotheses]
        )
        innovation = self._bank.update(readings)
        self._burns = [burn for burn in self._burns if burn.t_s >= readings.t_s]
        return innovation

    def estimate(self, t_s: float) -> Estimate | None:
        return self._at(self._bank.best, t_s, with_last=True).estimate()

    def _at(self, belief: Belief, t_s: float, *, with_last: bool) -> Belief:
        later = self._propagation.later(belief, t_s, self._burns, with_last=with_last)
        if later.oriented and not has_attitude(later.covariance):
            return self._propagation.disoriented(later)
        return later


class EkfNavigator(KalmanNavigator):
    """The extended Kalman filter."""

    linearisation = Tangents()


class UkfNavigator(KalmanNavigator):
    """The unscented Kalman filter."""

    linearisation = SigmaPoints()
