"""Controller ``lqr``: the linear-quadratic regulator on the exact linear motion about the target."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._guidance.impulse import SAME_INSTANT_S, carried_out, check_waypoints
from posse_core._guidance.motion import RelativeMotion
from posse_core._guidance.options import LqrOptions
from posse_core._interfaces.controller import Controller, ControlProblem, Waypoint
from posse_core._interfaces.navigator import Estimate


class LqrController(Controller[LqrOptions]):
    """Least sum of squares of impulses and of deviations from the waypoints, without constraints.

    The gains of all instants are computed at the start by one backward Riccati recursion over the
    flight (Anderson and Moore, Optimal Control, 1990, ch. 2 and 4), with the transition matrices of
    Yamanaka and Ankersen, so they vary along an eccentric orbit. Deviations count at the instant of
    each waypoint and, while it is held, at each later instant of an impulse, after that impulse.
    Between waypoints only impulses count, so that a transfer is the one of least sum of squares.
    """

    def start(self, problem: ControlProblem) -> None:
        check_waypoints(problem, "lqr")
        self._problem = problem
        self.gains, self.offsets = self._recursion()

    def command(self, estimate: Estimate) -> FloatArray:
        now = int(np.argmin(np.abs(self._problem.burns_s - estimate.t_s)))
        state = np.concatenate([estimate.r_rtn_m, estimate.v_rtn_m_s])
        return carried_out(self.offsets[now] - self.gains[now] @ state, self._problem)

    def _recursion(self) -> tuple[FloatArray, FloatArray]:
        """Gains (B, 3, 6) and offsets (B, 3): the impulse is offset − gain · state.

        The cost to go from after the impulse at an instant is xᵀSx − 2sᵀx and a constant.
        """
        burns, options = self._problem.burns_s, self.options
        weight = np.repeat([options.position_m**-2.0, options.velocity_m_s**-2.0], 3)
        effort = np.eye(3) * options.impulse_m_s**-2.0
        arrivals = [waypoint.t_s for waypoint in self._problem.waypoints]
        instants = np.unique(np.concatenate([burns, arrivals]))
        gains, offsets = np.zeros((len(burns), 3, 6)), np.zeros((len(burns), 3))
        S, s = np.zeros((6, 6)), np.zeros(6)
        for k in reversed(range(len(instants))):
            if k + 1 < len(instants):
                motion = RelativeMotion(self._problem.target, float(instants[k]))
                phi = motion.transition(instants[k + 1 : k + 2])[0]
                S, s = phi.T @ S @ phi, phi.T @ s
            for goal in self._goals(float(instants[k])):
                wanted = np.concatenate([goal.r_rtn_m, goal.v_rtn_m_s])
                S, s = S + np.diag(weight), s + weight * wanted
            for burn in np.flatnonzero(burns == instants[k]):
                inverse = np.linalg.inv(effort + S[3:, 3:])
                gains[burn], offsets[burn] = inverse @ S[3:], inverse @ s[3:]
                S, s = S - S[:, 3:] @ gains[burn], s - S[:, 3:] @ offsets[burn]
        return gains, offsets

    def _goals(self, t_s: float) -> list[Waypoint]:
        """The waypoints whose deviation counts at an instant."""
        return [
            waypoint
            for waypoint in self._problem.waypoints
            if waypoint.t_s - SAME_INSTANT_S <= t_s <= waypoint.until_s + SAME_INSTANT_S
        ]
