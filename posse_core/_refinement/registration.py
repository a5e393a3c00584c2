"""Where a drawing lies in the image: shifted, turned in the image's plane, nearer or farther."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array
from posse_core._frames import R_about, unit
from posse_core._refinement.crop import Crop
from posse_core._refinement.placement import Placement

_SIZES = (0.82, 0.88, 0.94, 1.0, 1.06, 1.13, 1.21)
_TURNS_DEG = (-18.0, -12.0, -6.0, 0.0, 6.0, 12.0, 18.0)
_SHIFT_PX = 5
"""Sizes and turns that are tried, and how far to each side, in the crop's pixels."""
_LEAST_PX = 10


class Registered(NamedTuple):
    """A pose at which a drawing lies as the image shows it.

    Attributes:
        placement: the pose.
        rise: by how much the correlation of drawing and image has risen.
    """

    placement: Placement
    rise: float


def registered(crop: Crop, modelled: Float32Array, near: BoolArray, placement: Placement) -> Registered:
    """Move a drawing, without drawing it anew, to where it agrees with the crop most.

    It is shifted, turned and scaled as a similarity of the image's plane, so the side that it shows
    stays the same. All shifts are tried at once, by normalised correlation with a mask (Padfield 2012).

    Args:
        modelled: (h, w) what would be seen in the crop at the pose.
        near: (h, w) pixels on the spacecraft or a little beside it.
        placement: the pose.
    """
    R, t_m = placement
    middle_px = crop.camera.project(t_m[None])[0]
    middle = tuple(crop.own_px(middle_px).tolist())
    seen = np.pad(crop.seen, _SHIFT_PX, mode="edge")
    there = _scores(seen, modelled, near)[_SHIFT_PX, _SHIFT_PX]
    best, size, turn_deg, shift_px = there, 1.0, 0.0, np.zeros(2)
    for each_size in _SIZES:
        for each_deg in _TURNS_DEG:
            # OpenCV counts turns against the way from x to y.
            matrix = cv2.getRotationMatrix2D(middle, -each_deg, each_size)
            extent = modelled.shape[::-1]
            moved = cv2.warpAffine(modelled, matrix, extent, borderMode=cv2.BORDER_REPLICATE)
            on = cv2.warpAffine(near.astype(np.uint8), matrix, extent, flags=cv2.INTER_NEAREST) > 0
            scores = _scores(seen, np.asarray(moved, np.float32), on)
            row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
            if scores[row, column] > best:
                best, size, turn_deg = scores[row, column], each_size, each_deg
                shift_px = np.array([column, row], np.float64) - _SHIFT_PX
    ray = crop.camera.rays(middle_px + crop.scale.finer * shift_px)
    turn = R_about(unit(t_m), np.radians(turn_deg))
    return Registered(Placement(turn @ R, ray * t_m[2] / size), float(best - there))


def _scores(seen: Float32Array, modelled: Float32Array, near: BoolArray) -> Float32Array:
    """(rows, columns) correlation of a drawing with an image at each shift, -1 where there is none.

    Args:
        seen: (h + 2 s, w + 2 s) the image with a margin of the largest shift s.
        modelled, near: (h, w), as of :func:`registered`.
    """
    rows, columns = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
    if np.count_nonzero(near) < _LEAST_PX:
        return np.full((2 * _SHIFT_PX + 1,) * 2, -1, np.float32)
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    scores = cv2.matchTemplate(
        seen[top : bottom + 2 * _SHIFT_PX, left : right + 2 * _SHIFT_PX],
        modelled[top:bottom, left:right],
        cv2.TM_CCOEFF_NORMED,
        mask=near[top:bottom, left:right].astype(np.float32),
    )
    return np.asarray(np.where(np.abs(scores) <= 1.001, scores, -1), np.float32)
