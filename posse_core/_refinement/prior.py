"""How likely a pose is before the image is compared, by the keypoints from which the starts come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._evaluation.poses import nees, pose_errors
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.trust import ANGLE_RAD, RANGE_SHARE
from posse_core._refinement.placement import Placement

_LEAST_TRUST, _POWER = 0.01, 0.5
"""The chance of a start rises with this power of its trust, which is often too sure."""
_FREEDOM, _FREEDOM_OF_PLACE = 12.0, 6.0
"""Squares of distances above twice the number of unknowns are far more often than a normal distribution
has them."""
_OTHER_SIDE, _SURE = 0.33, 0.9
"""Keypoints may have been found on another side, which leaves the place right: how likely any other
attitude is there, and how much less where a start is sure."""
_WITHIN = 16.8
"""99 % of poses are nearer to the truth, by a right covariance (χ² of 6 unknowns)."""


def prior(
    placement: Placement, starts: Sequence[PoseEstimate], symmetries: Sequence[FloatArray]
) -> float:
    """How likely a pose is among others, by that start which says most for it.

    It falls with the distance from the start, in standard deviations of the start's covariance, as
    heavy tails do; where the place is the start's, other attitudes keep some of it
    (docs/refining.md#how-certain-a-refined-pose-is).
    """
    # All are of one detection: where one is sure, the others' sides are less likely too.
    other_side = _OTHER_SIDE * (1 - _SURE * max(start.trust for start in starts))
    return max(_by_one(placement, start, other_side, symmetries) for start in starts)


def _by_one(
    placement: Placement, start: PoseEstimate, other_side: float, symmetries: Sequence[FloatArray]
) -> float:
    alike = 1 / (1 + squared_distance(placement, start, symmetries) / _FREEDOM)
    away_m = placement.t_body_cam_m - start.t_body_cam_m
    off = float(away_m @ np.linalg.pinv(start.covariance[3:, 3:]) @ away_m)
    turned = other_side / (1 + off / _FREEDOM_OF_PLACE)
    return float((start.trust + _LEAST_TRUST) ** _POWER * alike + turned)


def squared_distance(
    placement: Placement, start: PoseEstimate, symmetries: Sequence[FloatArray]
) -> float:
    """The square of the distance of a pose from a start, in standard deviations of the start's
    covariance (Mahalanobis)."""
    centre = start.R_cam_from_body, start.t_body_cam_m
    return nees(*placement, *centre, start.covariance, symmetries)


def is_near(placement: Placement, start: PoseEstimate, symmetries: Sequence[FloatArray]) -> bool:
    """Whether a pose is where it would be if its start were right: as near to it as a right pose is to
    the truth, or where it is likely to be by the start's covariance."""
    e_t, e_q_rad = pose_errors(*Placement.of(start), *placement, symmetries)
    is_alike = e_t < RANGE_SHARE and e_q_rad < ANGLE_RAD
    return is_alike or squared_distance(placement, start, symmetries) < _WITHIN
