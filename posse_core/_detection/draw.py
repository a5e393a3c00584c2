"""Drawing detections into an image."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._detection.square import to_grey
from posse_core._interfaces.detector import Detection

_COLOURS = ((80, 220, 80), (60, 160, 255), (255, 120, 80), (220, 80, 220))  # blue, green, red


def draw(image: AnyArray, detections: Sequence[Detection], classes: Sequence[str]) -> AnyArray:
    """Draw boxes, classes, scores and keypoints into a grey copy of an image.

    Args:
        image: (H, W) or (H, W, 3), uint8 or uint16.
        detections: what to draw.
        classes: names of all classes; the index of a class determines its colour.

    Returns:
        (H, W, 3) uint8 in OpenCV's order, blue-green-red.
    """
    canvas = cv2.cvtColor(np.round(255 * to_grey(image)).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    size = max(canvas.shape[:2])
    line, font = max(1, size // 400), max(0.3, size / 1200)
    for found in detections:
        colour = _COLOURS[classes.index(found.label) % len(_COLOURS)]
        x, y, width, height = np.round(found.box_px).astype(int).tolist()
        cv2.rectangle(canvas, (x, y), (x + width - 1, y + height - 1), colour, line)
        text = f"{found.label} {found.score:.2f}"
        above = max(y - 2 * line, round(25 * font))
        cv2.putText(canvas, text, (x, above), cv2.FONT_HERSHEY_SIMPLEX, font, colour, line, cv2.LINE_AA)
        for u, v in () if found.keypoints_px is None else np.round(found.keypoints_px).astype(int):
            cv2.circle(canvas, (int(u), int(v)), 2 * line, colour, -1, cv2.LINE_AA)
    return canvas
