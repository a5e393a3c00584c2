"""Which of the poses that a search ends at take the place of their starts, or confirm them."""

from __future__ import annotations

import numpy as np

from posse_core._frames import turn_rad
from posse_core._interfaces.detector import PoseEstimate
from posse_core._refinement.placement import Placement

_LEFT = 0.9
"""What is left of the disagreement must be less than this share of it."""
_LEAST_SHAPE = 0.55
"""Least agreement of outlines and creases alone, and by how much it must rise."""
_SHAPE_RISE = 0.02
_LARGEST_TURN_RAD = np.radians(30)
_LARGEST_SHARE = 0.3
"""A pose found by outlines alone that is farther from its start is not accepted: the turn, and the share
of the range."""
_LEAST_CONFIRMED = 0.5
"""Least agreement at which a start is confirmed near which the search ends."""
_LEAST_CERTAINTY, _SHARE_OF_TRUST = 0.2, 0.5
"""A pose is accepted if it is near a start that is trusted by at least this share of the greatest trust
of a start, or else at least so certain, and trusted more than what it leaves of that trust. A start is
confirmed if what is found near it is at least so certain."""


def is_likely(
    pose: PoseEstimate, certainty: float, near: PoseEstimate | None, most: float, refused: float
) -> bool:
    """Whether a pose may be accepted.

    Args:
        pose: that was found.
        certainty: of the pose, by the search.
        near: the start from which it was found, if it is near that.
        most: trust of the start that is trusted most.
        refused: what is left of the certainty of a start that an image does not confirm.
    """
    if near is not None and near.trust >= _SHARE_OF_TRUST * most:
        return True
    left = most * left_of_start(certainty, refused)
    return certainty >= _LEAST_CERTAINTY and pose.trust >= left


def left_of_start(certainty: float, refused: float) -> float:
    """What is left of the certainty of a start that is not confirmed.

    Args:
        certainty: of a pose elsewhere that was found by a search from all sides; 0 if there is none.
        refused: what would be left without that.
    """
    return refused * (1 - certainty)


def is_confirming(agreement: float, certainty: float) -> bool:
    """Whether a pose that was found near a start, and is no better, confirms it."""
    return agreement >= _LEAST_CONFIRMED and certainty >= _LEAST_CERTAINTY


def has_fallen(before: float, after: float) -> bool:
    """Whether an image disagrees clearly less than before, by its agreements."""
    return 1 - after < _LEFT * (1 - before)


def is_plausible(found: Placement, agreement: float, first: Placement, before: float) -> bool:
    """Whether a pose that was found by outlines alone may be better than its start.

    Args:
        found, agreement: the pose, and how much of the outlines it explains.
        first, before: the start, and how much of them that explains.
    """
    share = np.linalg.norm(found.t_body_cam_m - first.t_body_cam_m) / np.linalg.norm(first.t_body_cam_m)
    return bool(
        agreement >= _LEAST_SHAPE
        and agreement > before + _SHAPE_RISE
        and turn_rad(found.R_cam_from_body, first.R_cam_from_body) < _LARGEST_TURN_RAD
        and share < _LARGEST_SHARE
    )
