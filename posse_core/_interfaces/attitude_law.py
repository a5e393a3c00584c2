"""Attitude laws: how the target's body, or the chaser's camera, is oriented."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from posse_core._arrays import FloatArray, IntArray
from posse_core._environment.time import Epoch
from posse_core._plugins.component import Component, OptionsT
from posse_core._scenario.attitude import Subject


@dataclass(frozen=True)
class Surroundings:
    """What an attitude law may depend on, for F frames; ECI means geocentric, GCRF axes.

    Attributes:
        subject: what is oriented, ``"target"`` or ``"camera"``.
        epoch: the instant of t_s = 0.
        seed: of the run.
        t_s: (F,) seconds after the epoch.
        indices: (F,) index of each frame, on which its random draws depend.
        r_target_eci_m, v_target_eci_m_s: (F, 3) state of the target.
        r_sun_eci_m: (F, 3) position of the Sun.
        r_sun_epoch_eci_m: (3,) position of the Sun at t_s = 0.
        r_chaser_rtn_m: (F, 3) position of the chaser, which carries the camera, relative to the target,
            in the target's RTN axes.
    """

    subject: Subject
    epoch: Epoch
    seed: int
    t_s: FloatArray
    indices: IntArray
    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    r_sun_eci_m: FloatArray
    r_sun_epoch_eci_m: FloatArray
    r_chaser_rtn_m: FloatArray


class AttitudeLaw(Component[OptionsT]):
    """Orients the target's body or the chaser's camera.

    A frame's attitude depends on its own row of the surroundings alone, to the bit, and not on what was
    asked for before. Random errors are drawn by ``random_generator(seed, index, purpose)``.

    The angular velocity of a frame is the difference of the attitudes 1 ms before and after it, for
    which ``t_s`` differs, target and chaser are moved along their velocities, and all else is as at the
    frame. So a law has no jumps of attitude or rate in time; a random error changes from one index to
    the next and not with time.
    """

    @abstractmethod
    def attitude(self, around: Surroundings) -> FloatArray:
        """Return R_eci_from_body, or R_eci_from_camera where the subject is the camera.

        Args:
            around: of F frames; its arrays must not be modified.

        Returns:
            (F, 3, 3) float64 rotation matrices. Camera axes are OpenCV's: x right, y down, z forward.

        Raises:
            posse_core.InputError: The law is undefined at a frame; the message names the frame and a law
                to use instead.
        """
