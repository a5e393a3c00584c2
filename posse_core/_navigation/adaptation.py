"""Noise that is scaled by what is seen.

The keypoints' noise: the residuals that are left after an update have the covariance R − H P Hᵀ if all
is as modelled, so their squares plus H P Hᵀ estimate R (Mohamed and Schwarz 1999, J. Geodesy 73, 193;
Akhlaghi, Zhou and Huang 2017, IEEE PES General Meeting). One factor on all of R is learnt from them.

The process noise: the corrections of velocity and rate have the covariance P⁻ − P⁺ if all is as modelled
(the same authors' estimate of Q). Corrections that are larger raise the process noise, which the options
give at least, and smaller ones lower it again.
"""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._navigation.belief import Scales
from posse_core._navigation.kinematics import RATE, VELOCITY

KEYPOINTS = (0.25, 25.0)
PROCESS = (1.0, 1e4)
"""Least and largest factors on the covariances."""
FIRST_FRAMES = 4
"""Weight of the options at the start, in frames."""
_LARGEST_RESIDUALS, _LARGEST_CORRECTION = 10.0, 30.0
"""One frame counts for no more than this, in units of what was expected."""


def keypoint_scale(scale: float, found: FloatArray, expected: FloatArray, frames: float) -> float:
    """The factor on the keypoints' noise after a frame.

    Args:
        scale: the factor before.
        found: (m,) squared residuals after the update, plus the diagonal of H P Hᵀ.
        expected: (m,) the diagonal of R, with the factor.
        frames: over how many frames is averaged.
    """
    ratio = min(float(np.mean(found / expected)), _LARGEST_RESIDUALS)
    return float(np.clip(scale * (1 + (ratio - 1) / frames), *KEYPOINTS))


def process_scales(
    scales: Scales, correction: FloatArray, gained: FloatArray, oriented: bool, frames: float
) -> tuple[float, float]:
    """The factors on the process noise of motion and attitude after a frame.

    Args:
        scales: the factors before.
        correction: (12,) of the update.
        gained: (12, 12) the covariance before minus that after.
        oriented: whether the attitude was known.
        frames: over how many frames is averaged.
    """

    def grown(scale: float, part: slice) -> float:
        expected = gained[part, part] + 1e-12 * np.eye(3) * max(np.trace(gained[part, part]), 1e-30)
        ratio = float(correction[part] @ np.linalg.solve(expected, correction[part])) / 3
        step = (min(max(ratio, 0.0), _LARGEST_CORRECTION) - 1) / frames
        return float(np.clip(scale * math.exp(step), *PROCESS))

    return (
        grown(scales.motion, VELOCITY),
        grown(scales.turning, RATE) if oriented else scales.turning,
    )
