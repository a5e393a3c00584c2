"""Drawing boxes, points, arrows and words into an image, and the detections of a detector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import AnyArray
from posse_core._imaging.grey import to_grey
from posse_core._interfaces.detector import Detection

Colour = tuple[int, int, int]
"""Values of the three channels, 0 … 255, in the canvas' order."""
_COLOURS = ((80, 220, 80), (60, 160, 255), (255, 120, 80), (220, 80, 220))  # blue, green, red
_FARTHEST_PX = 32000
"""OpenCV's lines are wrong where a position is not a 16-bit number."""


@dataclass(frozen=True)
class Pen:
    """Draws into a canvas, in lines and letters that suit its size.

    The centre of the canvas' top-left pixel is (0, 0). What is not finite, or far outside the canvas, is
    not drawn.

    Attributes:
        canvas: (H, W, 3) uint8, in any order of channels; it is changed.
        size_px: longer side of the canvas that lines and letters suit; by default this one's.
    """

    canvas: AnyArray
    size_px: int | None = None

    @property
    def _size_px(self) -> int:
        return int(max(self.canvas.shape[:2])) if self.size_px is None else self.size_px

    @property
    def line_px(self) -> int:
        """Width of a line."""
        return max(1, self._size_px // 400)

    @property
    def font(self) -> float:
        """OpenCV's scale of letters; one is 25 pixels high."""
        return max(0.3, self._size_px / 1200)

    def box(self, box_px: ArrayLike, colour: Colour) -> None:
        """The outermost pixels of a box x, y, width, height."""
        rounded = _rounded(box_px)
        if rounded is not None:
            x, y, width, height = rounded
            corner = (x + width - 1, y + height - 1)
            cv2.rectangle(self.canvas, (x, y), corner, colour, self.line_px)

    def point(self, at_px: ArrayLike, colour: Colour, *, hidden: bool = False) -> None:
        """A dot, or a ring for what is hidden."""
        rounded = _rounded(at_px)
        if rounded is not None:
            thickness = self.line_px if hidden else -1
            cv2.circle(self.canvas, rounded, 2 * self.line_px, colour, thickness, cv2.LINE_AA)

    def cross(self, at_px: ArrayLike, colour: Colour) -> None:
        """A cross that stands upright."""
        rounded = _rounded(at_px)
        if rounded is not None:
            size_px = 8 * self.line_px
            cv2.drawMarker(self.canvas, rounded, colour, cv2.MARKER_CROSS, size_px, self.line_px)

    def arrow(self, start_px: ArrayLike, end_px: ArrayLike, colour: Colour, name: str) -> None:
        """An arrow with its name beside the tip, but within the canvas."""
        start, end = _rounded(start_px), _rounded(end_px)
        if start is not None and end is not None:
            cv2.arrowedLine(self.canvas, start, end, colour, self.line_px, cv2.LINE_AA, tipLength=0.12)
            height, width = self.canvas.shape[:2]
            letter_px = round(25 * self.font)
            x = min(max(end[0] + 3 * self.line_px, 0), width - letter_px * len(name))
            self.words(name, (x, min(max(end[1], letter_px), height - 1)), colour)

    def words(self, text: str, at_px: tuple[int, int], colour: Colour) -> None:
        """Words of ASCII letters; their lower left corner is given."""
        cv2.putText(
            self.canvas,
            text,
            at_px,
            cv2.FONT_HERSHEY_SIMPLEX,
            self.font,
            colour,
            self.line_px,
            cv2.LINE_AA,
        )


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
    pen = Pen(canvas)
    for found in detections:
        colour = _COLOURS[classes.index(found.label) % len(_COLOURS)]
        pen.box(found.box_px, colour)
        x, y = np.round(found.box_px[:2]).astype(int).tolist()
        above = max(y - 2 * pen.line_px, round(25 * pen.font))
        pen.words(f"{found.label} {found.score:.2f}", (x, above), colour)
        for point_px in () if found.keypoints_px is None else found.keypoints_px:
            pen.point(point_px, colour)
    return canvas


def _rounded(px: ArrayLike) -> tuple[int, ...] | None:
    """Positions in whole pixels; None for those that OpenCV cannot draw."""
    values = np.asarray(px, dtype=np.float64)
    if not (np.abs(values) < _FARTHEST_PX).all():  # NaN is not
        return None
    return tuple(np.round(values).astype(int).tolist())
