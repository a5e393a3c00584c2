"""Which of the poses that a search ends at take the place of their starts, or confirm them."""

from __future__ import annotations

import numpy as np

from posse_core._frames import turn_rad
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
"""A pose far from its start is accepted if it is at least so certain, and by at least so much of the
greatest trust of a start; and a start is confirmed if what is found near it is at least so certain."""


def is_likely(certainty: float, trust: float) -> bool:
    """Whether a pose that is so certain may be accepted far from its start, where the start that is
    trusted most has this trust."""
    return certainty >= max(_LEAST_CERTAINTY, _SHARE_OF_TRUST * trust)


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
