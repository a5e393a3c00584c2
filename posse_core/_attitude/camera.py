"""Attitude of the camera: its boresight at the target, or off it by a pointing error."""

from __future__ import annotations

from typing import assert_never

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._attitude.recorded import recorded_attitude
from posse_core._attitude.sight import R_rtn_by_sight
from posse_core._attitude.target import Surroundings
from posse_core._frames import (
    R_GL_FROM_CAM,
    R_eci_from_rtn,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from posse_core._randomness import random_generator
from posse_core._scenario.attitude import CameraLaw, FileLaw, PointingErrorLaw, TrackLaw

R_RTN_FROM_RESTING_CAM: FloatArray = R_GL_FROM_CAM
"""A Blender camera without a rotation looks along −z with +y up; the scene's axes are RTN."""
_BORESIGHT_CAM, _UP_CAM = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])


def R_eci_from_camera(law: CameraLaw, around: Surroundings, seed: int) -> FloatArray:
    """Return the camera's attitude by the law that the scenario names: (F, 3, 3).

    Args:
        law: the law.
        around: the states that laws depend on.
        seed: of the run; the random error of a frame depends on it and the frame's index alone.

    Raises:
        InputError: The camera is at the target, or a file of attitudes cannot be used.
    """
    if isinstance(law, FileLaw):
        return recorded_attitude(law.path, "q_eci_from_camera", around.epoch, around.t_s)
    R_eci_rtn = R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s)
    return R_eci_rtn @ R_rtn_from_camera(law, around.r_chaser_rtn_m, around.indices, seed)


def R_rtn_from_camera(
    law: TrackLaw | PointingErrorLaw, r_chaser_rtn_m: FloatArray, indices: IntArray, seed: int
) -> FloatArray:
    """Return the attitude of a camera that points at the target, in RTN axes: (F, 3) → (F, 3, 3).

    Args:
        law: the law.
        r_chaser_rtn_m: the camera's position relative to the target.
        indices: (F,) of the frames; a frame's random error depends on the seed and its index alone.
        seed: of the run.

    Raises:
        InputError: The camera is at the target.
    """
    aimed = looking_at_target(r_chaser_rtn_m, indices)
    draws = [random_generator(seed, int(index), "pointing") for index in indices]
    match law:
        case TrackLaw():
            influence = np.array([1 - law.offset * draw.uniform() for draw in draws])
            turn = rotation_vector_from_matrix(R_RTN_FROM_RESTING_CAM.T @ aimed)
            start, turn = R_RTN_FROM_RESTING_CAM, influence[:, None] * turn
        case PointingErrorLaw():
            jitter = np.array([draw.standard_normal(3) for draw in draws]) * law.jitter_deg
            start, turn = aimed, np.radians(law.bias_deg + jitter)
        case _:
            assert_never(law)
    return np.asarray(start @ matrix_from_rotation_vector(turn))


def looking_at_target(r_chaser_rtn_m: FloatArray, indices: IntArray) -> FloatArray:
    """Return attitudes with the boresight at the target's origin and the image's top nearest to N.

    They are (F, 3, 3); see ``sight`` for the exception along N.

    Raises:
        InputError: The camera is at the target.
    """
    return R_rtn_by_sight(-r_chaser_rtn_m, _BORESIGHT_CAM, _UP_CAM, indices)
