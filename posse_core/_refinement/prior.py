"""How likely a pose is before the image is compared, by the keypoints from which the starts come."""

from __future__ import annotations

from collections.abc import Sequence

from posse_core._arrays import FloatArray
from posse_core._evaluation.poses import nees
from posse_core._interfaces.detector import PoseEstimate
from posse_core._refinement.placement import Placement

_LEAST_TRUST, _POWER = 0.01, 0.5
"""The chance of a start rises with this power of its trust, which is often too sure."""
_FREEDOM = 12.0
"""Squares of distances above twice the number of unknowns are far more often than a normal distribution
has them."""
_MISTAKEN = 0.05
"""What is left wherever a pose is, since keypoints may have been found on another side."""
_WITHIN = 16.8
"""99 % of poses are nearer to the truth, by a right covariance (χ² of 6 unknowns)."""


def prior(
    placement: Placement, starts: Sequence[PoseEstimate], symmetries: Sequence[FloatArray]
) -> float:
    """How likely a pose is among others, by that start which says most for it.

    It falls with the distance from the start, in standard deviations of the start's covariance, as
    heavy tails do (docs/refining.md#how-certain-a-refined-pose-is).
    """
    shares = [
        (start.trust + _LEAST_TRUST) ** _POWER
        * (1 / (1 + distance(placement, start, symmetries) / _FREEDOM) + _MISTAKEN)
        for start in starts
    ]
    return float(max(shares))


def distance(placement: Placement, start: PoseEstimate, symmetries: Sequence[FloatArray]) -> float:
    """The square of the distance of a pose from a start, in standard deviations of the start's
    covariance (Mahalanobis)."""
    centre = start.R_cam_from_body, start.t_body_cam_m
    return nees(*placement, *centre, start.covariance, symmetries)


def is_within(placement: Placement, start: PoseEstimate, symmetries: Sequence[FloatArray]) -> bool:
    """Whether a pose is where it is likely to be, if its start and the start's covariance are right."""
    return distance(placement, start, symmetries) < _WITHIN
