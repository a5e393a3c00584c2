"""The least sum of impulses of a flight whose state is known exactly, as a reference."""

from __future__ import annotations

import numpy as np

from posse_core._dynamics.start import Start
from posse_core._errors import ComponentError
from posse_core._guidance.goals import goals_of, half_widths
from posse_core._guidance.horizon import Horizon
from posse_core._guidance.planner import Planner
from posse_core._interfaces.controller import ControlProblem

HOLD_TOLERANCE_M = 0.05
"""Distance from a waypoint that counts as reached, m."""
HOLD_TOLERANCE_M_S = 0.001
"""The same of the velocity, m/s."""
_ACCURACY = 1e-3


def least_dv_m_s(
    problem: ControlProblem,
    start: Start,
    hold_tolerance_m: float = HOLD_TOLERANCE_M,
    hold_tolerance_m_s: float = HOLD_TOLERANCE_M_S,
) -> float:
    """Least sum of impulse sizes, m/s, for the waypoints of a problem and its instants of impulses.

    Thrusters are exact and everything is known. Waypoints are reached and held within boxes inside the
    tolerances, at all instants of impulses, as :class:`ImpulsiveMpc` does with its default options. The
    motion is exact without impulses and linear in them. Without a keep-out ellipsoid the sum is within
    0.1 % of the optimum; with one it is that of a plan that is optimal among those near it.

    Args:
        problem: the flight.
        start: the chaser at the epoch.
        hold_tolerance_m, hold_tolerance_m_s: distance from a waypoint, and difference of velocity, that
            count as reached.

    Raises:
        ComponentError: the solver failed.
    """
    if not len(problem.waypoints) or not len(problem.burns_s):
        return 0.0
    horizon = Horizon(problem, start.target.t_s, start.rtn)
    goals = goals_of(problem).after(start.target.t_s)
    widths = half_widths(problem, hold_tolerance_m, hold_tolerance_m_s)[goals.waypoint]
    planner = Planner(problem, accuracy=_ACCURACY)
    plan = planner.plan(horizon, horizon.box(goals, widths), np.zeros((6, 6)), None)
    if plan is None:
        raise ComponentError("the solver HiGHS failed on the least sum of impulses")
    return float(np.linalg.norm(plan.dv_m_s, axis=1).sum())
