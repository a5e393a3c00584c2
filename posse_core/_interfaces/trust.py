"""How likely it is that an estimated pose is right, by its own covariance."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse_core._arrays import FloatArray

RANGE_SHARE: Final = 0.05
ANGLE_RAD: Final = math.radians(5.0)
"""A pose is right if the error of its position is below this share of the range, and that of its
attitude below this angle."""

TRUSTED: Final = 0.5
"""A pose is trusted if it is more likely right than wrong."""


def trust(t_body_cam_m: FloatArray, covariance: FloatArray) -> float:
    """Return the probability that a pose is right, as far as its covariance tells.

    The errors of attitude and position are taken as normally distributed. Each squared error is a
    weighted sum of squares of standard normal variables, whose distribution is taken for the gamma
    distribution of its mean and variance (Satterthwaite 1946). Both errors are taken as independent.

    Args:
        t_body_cam_m: (3,) the pose's position.
        covariance: (6, 6) of a small rotation (rad) and of the position (m).

    Returns:
        0 … 1.
    """
    range_m = float(np.linalg.norm(t_body_cam_m))
    attitude = _within(ANGLE_RAD, covariance[:3, :3])
    position = _within(RANGE_SHARE * range_m, covariance[3:, 3:])
    return attitude * position


def _within(radius: float, covariance: FloatArray) -> float:
    """Return the probability that a normal variable of a covariance (3, 3) is so near to 0."""
    mean = float(np.trace(covariance))
    variance = 2 * float(np.sum(covariance**2))
    if not math.isfinite(variance):
        return 0.0
    if variance == 0:
        return 1.0
    # Here, since every command that loads plugins imports this module.
    from scipy.special import gammainc

    return float(gammainc(mean**2 / variance, radius**2 * mean / variance))
