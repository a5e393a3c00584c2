"""The motion that is estimated, and the twelve errors of it that a covariance is about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray

POSITION, VELOCITY = slice(0, 3), slice(3, 6)
ATTITUDE, RATE = slice(6, 9), slice(9, 12)
MOTION, TURNING = slice(0, 6), slice(6, 12)
"""Where the errors stand in the order of a covariance."""
SIZE = 12
LOST_RAD = 0.9
"""An attitude with a larger standard deviation about any axis is not known. Beyond it sigma points would
lie more than half a turn from the mean."""


@dataclass(frozen=True)
class Kinematics:
    """Relative motion and attitude, of one instant; leading axes hold several of them.

    Attributes:
        dr_eci_m, dv_eci_m_s: (..., 3) chaser minus target, GCRF axes.
        R_eci_from_body: (..., 3, 3) the target's attitude.
        omega_body_rad_s: (..., 3) its angular velocity relative to GCRF axes, body axes.
    """

    dr_eci_m: FloatArray
    dv_eci_m_s: FloatArray
    R_eci_from_body: FloatArray
    omega_body_rad_s: FloatArray

    def plus(self, errors: FloatArray) -> Kinematics:
        """Add errors (..., 12) of position, velocity, attitude (R · exp(θ×)) and rate."""
        return Kinematics(
            self.dr_eci_m + errors[..., POSITION],
            self.dv_eci_m_s + errors[..., VELOCITY],
            self.R_eci_from_body @ frames.matrix_from_rotation_vector(errors[..., ATTITUDE]),
            self.omega_body_rad_s + errors[..., RATE],
        )

    def minus(self, other: Kinematics) -> FloatArray:
        """The errors (..., 12) that added to ``other`` give this."""
        turn = np.swapaxes(other.R_eci_from_body, -1, -2) @ self.R_eci_from_body
        return np.concatenate(
            [
                self.dr_eci_m - other.dr_eci_m,
                self.dv_eci_m_s - other.dv_eci_m_s,
                frames.rotation_vector_from_matrix(turn),
                self.omega_body_rad_s - other.omega_body_rad_s,
            ],
            axis=-1,
        )


def has_attitude(covariance: FloatArray) -> bool:
    """Whether a covariance (12 or more, ...) leaves anything of the attitude."""
    return bool(np.linalg.eigvalsh(covariance[ATTITUDE, ATTITUDE])[-1] <= LOST_RAD**2)


def moved_tangent(theta_rad: FloatArray, size: int) -> FloatArray:
    """(size, size) what errors about x are about x.plus(δ), where δ turns by ``theta_rad`` (3,)."""
    matrix = np.eye(size)
    matrix[ATTITUDE, ATTITUDE] = frames.right_jacobian(theta_rad)
    return matrix
