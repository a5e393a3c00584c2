"""What all controllers share: goals that are needed, instants, and what thrusters can carry out."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._interfaces.controller import ControlProblem

SAME_INSTANT_S = 1e-6
"""Instants that differ by less are the same."""


def carried_out(dv_m_s: FloatArray, problem: ControlProblem) -> FloatArray:
    """(3,) the impulse that is commanded for a wanted one.

    It is zero below the least impulse of the thrusters, and shortened to the problem's limit.
    """
    size = float(np.linalg.norm(dv_m_s))
    if size == 0 or size < problem.thrusters.least_m_s:
        return np.zeros(3)
    return np.asarray(dv_m_s * min(1.0, problem.largest_m_s / size))


def check_waypoints(problem: ControlProblem, name: str) -> None:
    """Refuse a problem without a goal, and an orbit that the linear motion does not exist for.

    Raises:
        InputError: there are no waypoints, or the target's orbit is not elliptic.
    """
    problem.target.check(elliptic=True)
    if not problem.waypoints:
        raise InputError(
            f"controller {name} needs a waypoint; add one, or choose controller hold or plan"
        )
