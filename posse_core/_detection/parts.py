"""An image searched in parts, each of which a network for boxes sees larger than in the whole."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._evaluation.metrics import box_iou
from posse_core._interfaces.detector import Detection, Detector
from posse_core._model.camera import PixelBox

_SIDES = 2
"""The longer side of an image over that of its parts."""
_CUT = 0.01
"""A box that is so near to a border within the image may be cut off: a share of the part's side."""
_ONE = 0.5
"""Boxes of a class that overlap by more are of one spacecraft: intersection over union."""


def parts_of(height_px: int, width_px: int) -> list[PixelBox]:
    """Return squares that cover an image and overlap by at least half, so that whatever is smaller than
    half of one is whole in one of them. They are cut off where the image is less high or wide."""
    side = -(-max(height_px, width_px) // _SIDES)
    return [
        PixelBox(x0, y0, min(side, width_px), min(side, height_px))
        for y0 in _firsts(height_px, side)
        for x0 in _firsts(width_px, side)
    ]


def found_in_parts(detector: Detector, image: AnyArray, classes: Container[str]) -> list[Detection]:
    """Search an image in parts.

    The images of a large sensor are made so much smaller for a network that a spacecraft of a few
    percent of the width is a few pixels wide.

    Args:
        detector: of boxes.
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        classes: of which detections are returned.

    Returns:
        The detections, best first, each spacecraft once; none that reaches a border within the image.
    """
    height_px, width_px = image.shape[:2]
    parts = parts_of(height_px, width_px)
    in_parts = detector.predict([image[part.slices] for part in parts])
    found = [
        replace(each, box_px=np.add(each.box_px, [part.x0, part.y0, 0, 0]))
        for part, here in zip(parts, in_parts, strict=True)
        for each in here
        if each.label in classes and _is_whole(each.box_px, part, height_px, width_px)
    ]
    kept: list[Detection] = []
    for each in sorted(found, key=lambda detection: -detection.score):
        if not any(is_one(each, other) for other in kept):
            kept.append(each)
    return kept


def is_one(detection: Detection, other: Detection) -> bool:
    """Whether two detections are of one spacecraft, by their boxes."""
    return detection.label == other.label and float(box_iou(detection.box_px, other.box_px)) > _ONE


def _firsts(length_px: int, side_px: int) -> Sequence[int]:
    """The first pixels of parts along one side of an image."""
    last = max(length_px - side_px, 0)
    count = 1 + -(-last // max(side_px // 2, 1))
    return [int(first) for first in np.linspace(0, last, count)]


def _is_whole(box_px: FloatArray, part: PixelBox, height_px: int, width_px: int) -> bool:
    """Whether a box (4,) in a part does not reach those of its borders that are within the image."""
    margin_px = _CUT * max(part.width, part.height)
    low, high = box_px[:2], box_px[:2] + box_px[2:]
    first, size = np.array([part.x0, part.y0]), np.array([part.width, part.height])
    is_cut = ((low < margin_px) & (first > 0)) | (
        (high > size - margin_px) & (first + size < [width_px, height_px])
    )
    return not bool(is_cut.any())
