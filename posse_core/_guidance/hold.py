"""Controller ``hold``: keeps the chaser where it is, by a deadband."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._guidance.impulse import carried_out
from posse_core._guidance.motion import RelativeMotion
from posse_core._guidance.options import HoldOptions
from posse_core._interfaces.controller import Controller, ControlProblem
from posse_core._interfaces.navigator import Estimate


class HoldController(Controller[HoldOptions]):
    """Keeps the first waypoint's position or, without waypoints, that of the first estimate.

    At each instant it predicts where the chaser would be ``return_s`` later. If that is outside the
    deadband in any axis, the impulse is the one that leads to the position by then.
    """

    def start(self, problem: ControlProblem) -> None:
        problem.target.check(elliptic=True)
        self._problem = problem
        self._kept = problem.waypoints[0].r_rtn_m.copy() if problem.waypoints else None

    def command(self, estimate: Estimate) -> FloatArray:
        if self._kept is None:
            self._kept = estimate.r_rtn_m.copy()
        state = np.concatenate([estimate.r_rtn_m, estimate.v_rtn_m_s])
        then = np.array([estimate.t_s + self.options.return_s])
        motion = RelativeMotion(self._problem.target, estimate.t_s)
        error_m = motion.drift(state, then)[0, :3] - self._kept
        if np.max(np.abs(error_m)) < self.options.deadband_m:
            return np.zeros(3)
        by_impulse = motion.transition(then)[0, :3, 3:]
        return carried_out(np.asarray(np.linalg.solve(by_impulse, -error_m)), self._problem)
