"""Attitudes of a trajectory and their angular velocities: by the scenario's laws, or as given."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._frames import quaternion_from_matrix, rotation_vector_from_matrix
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._plugins.registry import Registry
from posse_core._scenario.attitude import AttitudeConfig, LawChoice, Subject, check_law
from posse_core._scenario.component import create
from posse_core._trajectory.returned import CheckedLaw

RATE_STEP_S = 1e-3
"""Half the step of the differences that give angular velocities; they are exact for a steady spin."""
_LARGEST_NORM_ERROR = 1e-3
"""A given quaternion whose norm differs from one by more is refused as a mistake."""


@dataclass(frozen=True)
class Laws:
    """The attitude laws of a scenario."""

    target: AttitudeLaw
    camera: AttitudeLaw

    @classmethod
    def of(cls, config: AttitudeConfig, registry: Registry) -> Laws:
        """Make the laws that a scenario chooses.

        Raises:
            InputError: There is no such law, it is not made for target or camera, or an option is wrong.
            ComponentError: A law cannot be made.
        """

        def made(choice: LawChoice, subject: Subject) -> AttitudeLaw:
            check_law(registry, choice, subject, f"attitude.{subject}.law")
            return CheckedLaw(create(registry, "attitude-law", choice), choice.name)

        return cls(made(config.target, "target"), made(config.camera, "camera"))


@dataclass(frozen=True)
class GivenAttitude:
    """Attitudes that the caller gives for F frames; where one is None, the scenario's law applies.

    Attributes:
        q_eci_from_body, q_eci_from_camera: (F, 4) unit quaternions, scalar first, or None.
        omega_body_rad_s, omega_camera_rad_s: (F, 3) angular velocity relative to GCRF axes, in body axes
            and in camera axes; None means at rest. It is ignored where the attitude is None.
    """

    q_eci_from_body: FloatArray | None = None
    q_eci_from_camera: FloatArray | None = None
    omega_body_rad_s: FloatArray | None = None
    omega_camera_rad_s: FloatArray | None = None


def by_law(
    law: AttitudeLaw, around: Surroundings, v_chaser_rtn_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the attitude by a law, and its angular velocity in its own axes: (F, 4), (F, 3).

    The angular velocity is a central difference. The random errors of a law are the same at both times,
    since a camera's jitter changes between frames and not within one.

    Args:
        law: the law.
        around: of F frames.
        v_chaser_rtn_m_s: (F, 3) velocity of the chaser in the rotating RTN axes.
    """

    def near(after_s: float) -> FloatArray:
        moved = dataclasses.replace(
            around,
            t_s=around.t_s + after_s,
            r_target_eci_m=around.r_target_eci_m + after_s * around.v_target_eci_m_s,
            r_chaser_rtn_m=around.r_chaser_rtn_m + after_s * v_chaser_rtn_m_s,
        )
        return law.attitude(moved)

    turn = np.swapaxes(near(-RATE_STEP_S), -1, -2) @ near(RATE_STEP_S)
    q = quaternion_from_matrix(law.attitude(around))
    return q, rotation_vector_from_matrix(turn) / (2 * RATE_STEP_S)


def as_given(q: FloatArray, omega_rad_s: FloatArray | None, name: str) -> tuple[FloatArray, FloatArray]:
    """Return a given attitude, normalised and with w ≥ 0, and its angular velocity: (F, 4), (F, 3).

    Args:
        q: (F, 4) quaternions.
        omega_rad_s: (F, 3) angular velocity; None means at rest.
        name: of the quaternions, for the message.

    Raises:
        InputError: A quaternion is not of length one.
    """
    q = np.asarray(q, dtype=np.float64)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.abs(length - 1) < _LARGEST_NORM_ERROR):
        raise InputError(f"{name}: a quaternion is not of length one; give w, x, y, z of a rotation")
    # A quaternion that is normalised already, such as a trajectory's own, stays equal to the bit.
    q = np.where(np.abs(length - 1) < 4 * np.finfo(float).eps, q, q / length)
    rate = np.zeros((len(q), 3)) if omega_rad_s is None else np.asarray(omega_rad_s, dtype=np.float64)
    return np.where(q[:, :1] < 0, -q, q), rate
