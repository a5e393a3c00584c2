"""Pointing along the line between chaser and target, with the turn about it settled."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._frames import R_a_from_b_by_directions, unit

_POLE_ANGLE_RAD = 1e-6
"""Angle between a line of sight and the normal of the orbit below which N gives no direction."""
_R_RTN, _N_RTN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def R_rtn_by_sight(
    sight_rtn: FloatArray, axis: FloatArray, up: FloatArray, indices: IntArray
) -> FloatArray:
    """A body's ``axis`` along the line of sight, its ``up`` nearest to N: (F, 3) → (F, 3, 3).

    Where the line is along N within 1e-6 rad, ``up`` is nearest to R: every rule about the turn
    has such a place, and this one is passed by fewer orbits than ±R is.

    Args:
        sight_rtn: (F, 3) any length but 0, RTN axes.
        axis, up: (3,) in the body's axes, square to each other.
        indices: (F,) of the frames, for messages.

    Raises:
        InputError: a line of sight has no length, as chaser and target are at one place.
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
