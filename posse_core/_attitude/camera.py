"""Attitude laws of the camera: its boresight at the target, or off it by a pointing error."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._attitude.options import PointingErrorOptions, RandomPointingOptions, TrackOptions
from posse_core._attitude.sight import R_rtn_by_sight
from posse_core._frames import (
    R_GL_FROM_CAM,
    R_eci_from_rtn,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._plugins.component import OptionsT
from posse_core._randomness import random_generator

R_RTN_FROM_RESTING_CAM: FloatArray = R_GL_FROM_CAM
"""A Blender camera without a rotation looks along −z with +y up; the scene's axes are RTN."""
_BORESIGHT_CAM, _UP_CAM = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])


class AimedLaw(AttitudeLaw[OptionsT]):
    """A camera that is turned from the attitude that points at the target, by an error of its own."""

    def attitude(self, around: Surroundings) -> FloatArray:
        """See :meth:`AttitudeLaw.attitude`.

        Raises:
            InputError: The camera is at the target.
        """
        aimed = looking_at_target(around.r_chaser_rtn_m, around.indices)
        draws = [random_generator(around.seed, int(index), "pointing") for index in around.indices]
        R_eci_rtn = R_eci_from_rtn(around.r_target_eci_m, around.v_target_eci_m_s)
        return R_eci_rtn @ self.R_rtn_from_camera(aimed, draws)

    @abstractmethod
    def R_rtn_from_camera(self, aimed: FloatArray, draws: list[np.random.Generator]) -> FloatArray:
        """Return the attitude with its error, in RTN axes: (F, 3, 3).

        Args:
            aimed: (F, 3, 3) attitude without the error, RTN axes.
            draws: F generators of the frames' random numbers.
        """


class TrackLaw(AimedLaw[TrackOptions]):
    """The camera points at the target's origin, with a random offset.

    Without the offset, the image's top is as near as possible to the orbit's normal. Of the rotation
    that leads there from the attitude at rest (right R, up T, looking along −N), a share is taken back.
    The share is drawn for each frame between 0 and ``offset``, as Blender's track-to constraint does at
    an influence between 1 − ``offset`` and 1.
    """

    def R_rtn_from_camera(self, aimed: FloatArray, draws: list[np.random.Generator]) -> FloatArray:
        influence = np.array([1 - self.options.offset * draw.uniform() for draw in draws])
        turn = rotation_vector_from_matrix(R_RTN_FROM_RESTING_CAM.T @ aimed)
        return R_RTN_FROM_RESTING_CAM @ matrix_from_rotation_vector(influence[:, None] * turn)


class PointingErrorLaw(AimedLaw[PointingErrorOptions]):
    """The camera points at the target's origin but for a fixed misalignment and jitter.

    Both rotate the camera about its own axes: x right, y down, z forward.
    """

    def R_rtn_from_camera(self, aimed: FloatArray, draws: list[np.random.Generator]) -> FloatArray:
        jitter = np.array([draw.standard_normal(3) for draw in draws]) * self.options.jitter_deg
        turn = np.radians(self.options.bias_deg + jitter)
        return np.asarray(aimed @ matrix_from_rotation_vector(turn))


class RandomPointingLaw(AimedLaw[RandomPointingOptions]):
    """The boresight in a random direction near the target or away from it, with a random roll.

    Each frame draws its own: the direction evenly over the part of the sphere between the two angles,
    and the roll evenly over a full turn. Between 0° and 180° all rotations are equally likely (they are
    Euler's angles z-x-z, of which the cosine of the second is drawn evenly).
    """

    def R_rtn_from_camera(self, aimed: FloatArray, draws: list[np.random.Generator]) -> FloatArray:
        least, largest = np.cos(np.radians(self.options.off_axis_deg))
        share, roll, azimuth = np.array([draw.uniform(size=3) for draw in draws]).T
        off = np.arccos(np.clip(least + share * (largest - least), -1, 1))
        about = 2 * np.pi * azimuth
        roll_vector = 2 * np.pi * roll[:, None] * _BORESIGHT_CAM
        axis = np.stack([np.cos(about), np.sin(about), np.zeros_like(about)], axis=-1)
        turn = matrix_from_rotation_vector(roll_vector) @ matrix_from_rotation_vector(
            off[:, None] * axis
        )
        return np.asarray(aimed @ turn)


def looking_at_target(r_chaser_rtn_m: FloatArray, indices: IntArray) -> FloatArray:
    """Return attitudes with the boresight at the target's origin and the image's top nearest to N.

    They are (F, 3, 3) in RTN axes; see ``sight`` for the exception along N.

    Args:
        r_chaser_rtn_m: (F, 3) position of the camera relative to the target.
        indices: (F,) of the frames, for messages.

    Raises:
        InputError: The camera is at the target.
    """
    return R_rtn_by_sight(-r_chaser_rtn_m, _BORESIGHT_CAM, _UP_CAM, indices)
