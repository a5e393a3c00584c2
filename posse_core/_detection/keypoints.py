"""What keypoint nets agree on: the square that they see, and whose points are where in the outputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._detection.card import ModelCard
from posse_core._detection.square import Square, around

MARGIN = 1.3
"""Side of the square in sides of the box: room for points outside a box that is somewhat off."""


def square_for(box_px: FloatArray, size_px: int) -> Square:
    """The square that a net sees of a box (4,) x, y, width, height."""
    return around(box_px, size_px, MARGIN)


def points_of(card: ModelCard) -> dict[str, FloatArray]:
    """Class → (K, 3) keypoints, metres, body frame."""
    return {
        name: np.array(list(points.values()), np.float64).reshape(-1, 3)
        for name, points in card.keypoints_body_m.items()
    }


def keypoint_ranges(card: ModelCard) -> Mapping[str, slice]:
    """Class → its points among the outputs, which hold those of all classes, one after another."""
    ranges, start = {}, 0
    for name in card.classes:
        count = len(card.keypoints_body_m[name])
        ranges[name] = slice(start, start + count)
        start += count
    return ranges
