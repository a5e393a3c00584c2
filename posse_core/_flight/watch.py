"""A navigator at work: its readings reach it when they arrive, and what it returns is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._flight.returned import estimated, updated
from posse_core._interfaces.navigator import Estimate, Innovation, NavigationProblem, Navigator, Readings
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.component import failures_named
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice, create
from posse_core._simulator.frame import Frame


@dataclass(frozen=True)
class Step:
    """One frame of a flight or of a sequence, and what followed from it.

    Attributes:
        row: the true state at the frame, one row.
        frame: the frame; None where it was not made now.
        readings: of the frame.
        estimate: at the frame's instant, with what had arrived when the impulse was decided.
        innovations: index of a frame → the innovation of its readings, of those that arrived now.
        burn_s: the instant of the impulse.
        dv_commanded_rtn_m_s, dv_rtn_m_s: (3,) the impulse as commanded and as carried out.
    """

    row: Trajectory
    frame: Frame | None
    readings: Readings
    estimate: Estimate | None
    innovations: Mapping[int, Innovation]
    burn_s: float
    dv_commanded_rtn_m_s: FloatArray
    dv_rtn_m_s: FloatArray


class Watch:
    """A navigator, and the readings that are on their way to it."""

    def __init__(self, choice: ComponentChoice, registry: Registry, problem: NavigationProblem) -> None:
        """problem: what is known before the first reading."""
        self._name = choice.name
        self._needs_truth = "truth" in registry.spec("navigator", choice.name).capabilities
        self._navigator: Navigator = create(registry, "navigator", choice)
        self._waiting: list[Readings] = []
        with failures_named("navigator", self._name):
            self._navigator.start(problem)

    def read(self, readings: Readings, row: Trajectory) -> None:
        """Send readings on their way.

        Args:
            row: the true state at their instant, one row, for a navigator that needs it.
        """
        self._waiting.append(replace(readings, truth=_truth(row) if self._needs_truth else None))

    def deliver(self, until_s: float) -> dict[int, Innovation]:
        """Give the navigator the readings that have arrived: index of a frame → their innovation."""
        arrived = [readings for readings in self._waiting if readings.arrives_s <= until_s]
        self._waiting = [readings for readings in self._waiting if readings.arrives_s > until_s]
        made = {readings.index: updated(self._navigator, self._name, readings) for readings in arrived}
        return {index: innovation for index, innovation in made.items() if innovation is not None}

    def burned(self, burn: Burn) -> None:
        """Tell the navigator of an impulse that was commanded."""
        with failures_named("navigator", self._name):
            self._navigator.burned(burn)

    def estimate(self, t_s: float) -> Estimate | None:
        """What the navigator knows at an instant; None while it knows nothing."""
        return estimated(self._navigator, self._name, t_s)


def _truth(row: Trajectory) -> Estimate:
    return Estimate(
        float(row.t_s[0]),
        row.r_chaser_rtn_m[0],
        row.v_chaser_rtn_m_s[0],
        np.zeros((12, 12)),
        row.q_eci_from_body[0],
        row.omega_body_rad_s[0],
    )
