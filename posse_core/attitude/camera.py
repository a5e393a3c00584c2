"""Attitude of the camera: boresight at the target, and what keeps it from there."""

from __future__ import annotations

import numpy as np

from posse_core.errors import InputError
from posse_core.frames import (
    R_GL_FROM_CAM,
    R_a_from_b_by_directions,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    unit,
)
from posse_core.model.arrays import FloatArray
from posse_core.randomness import generator
from posse_core.scenario.attitude import TrackLaw

R_RTN_FROM_RESTING_CAM: FloatArray = R_GL_FROM_CAM
"""A Blender camera without a rotation looks along −z with +y up; the scene's axes are RTN."""
_POLE_TOLERANCE = 1e-6
_BORESIGHT_CAM, _UP_CAM = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
_R_RTN, _N_RTN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def R_rtn_from_camera(law: TrackLaw, r_chaser_rtn_m: FloatArray, seed: int) -> FloatArray:
    """The camera's attitude in the target's RTN axes: (F, 3) → (F, 3, 3).

    Args:
        r_chaser_rtn_m: the camera's place relative to the target.
        seed: of the run; a frame's draw depends on it and the frame's number alone.

    Raises:
        InputError: the camera is at the target.
    """
    aimed = looking_at_target(r_chaser_rtn_m)
    influence = np.array(
        [1 - law.offset * generator(seed, k, "pointing").uniform() for k in range(len(aimed))]
    )
    turn = rotation_vector_from_matrix(R_RTN_FROM_RESTING_CAM.T @ aimed)
    return np.asarray(R_RTN_FROM_RESTING_CAM @ matrix_from_rotation_vector(influence[:, None] * turn))


def looking_at_target(r_chaser_rtn_m: FloatArray) -> FloatArray:
    """Boresight at the target's origin, the image's top nearest to N: (F, 3) → (F, 3, 3).

    Where the line of sight is along N within 1e-6 rad, the image's top is R.

    Raises:
        InputError: the camera is at the target.
    """
    at_target = ~(np.linalg.norm(r_chaser_rtn_m, axis=-1) > 0)
    if np.any(at_target):
        raise InputError(
            f"the chaser is at the target at frame {np.argmax(at_target)}, so its camera has nowhere"
            " to look; change the relative motion"
        )
    sight = -unit(r_chaser_rtn_m)
    along_normal = np.hypot(sight[:, 0], sight[:, 1]) < _POLE_TOLERANCE
    up = np.where(along_normal[:, None], _R_RTN, _N_RTN)
    return R_a_from_b_by_directions(sight, up, _BORESIGHT_CAM, _UP_CAM)
