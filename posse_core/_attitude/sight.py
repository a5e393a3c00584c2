"""Pointing along the line of sight between chaser and target, with a rule for the roll about it."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._frames import R_a_from_b_by_directions, unit

_POLE_ANGLE_RAD = 1e-6
"""Angle between a line of sight and the orbit's normal below which N cannot define the roll."""
_R_RTN, _N_RTN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def R_rtn_by_sight(
    sight_rtn: FloatArray, axis: FloatArray, up: FloatArray, indices: IntArray
) -> FloatArray:
    """Point a body's ``axis`` along the line of sight with its ``up`` nearest to N: (F, 3) → (F, 3, 3).

    Where the line of sight is along N within 1e-6 rad, ``up`` is nearest to R instead. Every rule for
    the roll is singular in some direction, and fewer orbits pass through ±N than through ±R.

    Args:
        sight_rtn: (F, 3) lines of sight of any length but 0, RTN axes.
        axis, up: (3,) in body axes, perpendicular to each other.
        indices: (F,) of the frames, for messages.

    Raises:
        InputError: A line of sight has no length, since chaser and target are at the same position.
    """
    lost = ~(np.linalg.norm(sight_rtn, axis=-1) > 0)
    if np.any(lost):
        raise InputError(
            f"the chaser is at the target at frame {indices[np.argmax(lost)]}, so there is no line of"
            " sight; change the relative motion"
        )
    sight = unit(sight_rtn)
    along_normal = np.hypot(sight[:, 0], sight[:, 1]) < _POLE_ANGLE_RAD
    reference = np.where(along_normal[:, None], _R_RTN, _N_RTN)
    return R_a_from_b_by_directions(sight, reference, axis, up)
