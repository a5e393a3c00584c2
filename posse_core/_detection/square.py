"""Images as nets see them: grey, square, of a fixed size; and the way back to the image's pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._errors import InputError

_GREY_WEIGHTS = (0.2126, 0.7152, 0.0722)  # ITU-R BT.709, linear light


@dataclass(frozen=True)
class Square:
    """A square of an image, scaled to ``size_px``; it may reach beyond the image.

    Attributes:
        x_px, y_px: left and top edge, whole pixels of the image.
        side_px: its side in pixels of the image.
        size_px: its side after scaling.
    """

    x_px: int
    y_px: int
    side_px: int
    size_px: int

    @property
    def scale(self) -> float:
        """Pixels of the square for each pixel of the image."""
        return self.size_px / self.side_px

    def boxes_in(self, boxes_px: FloatArray) -> FloatArray:
        """(..., 4) x, y, width, height in the image → the same in the square."""
        return (np.asarray(boxes_px, np.float64) - [self.x_px, self.y_px, 0, 0]) * self.scale

    def boxes_out(self, boxes_px: FloatArray) -> FloatArray:
        """(..., 4) x, y, width, height in the square → the same in the image."""
        return np.asarray(boxes_px, np.float64) / self.scale + [self.x_px, self.y_px, 0, 0]

    def points_in(self, points_px: FloatArray) -> FloatArray:
        """(..., 2) in the image → in the square; pixel centres are whole numbers in both."""
        corner = np.array([self.x_px, self.y_px]) - 0.5
        return (np.asarray(points_px, np.float64) - corner) * self.scale - 0.5

    def points_out(self, points_px: FloatArray) -> FloatArray:
        """(..., 2) in the square → in the image."""
        corner = np.array([self.x_px, self.y_px]) - 0.5
        return (np.asarray(points_px, np.float64) + 0.5) / self.scale + corner

    def cut(self, image: AnyArray) -> Float32Array:
        """(size, size) of a grey (H, W) image; 0 beyond its border. Shrinking averages over areas."""
        height, width = image.shape
        x0, y0 = max(self.x_px, 0), max(self.y_px, 0)
        x1, y1 = min(self.x_px + self.side_px, width), min(self.y_px + self.side_px, height)
        whole = np.zeros((self.side_px, self.side_px), np.float32)
        if x1 > x0 and y1 > y0:
            place = np.s_[y0 - self.y_px : y1 - self.y_px, x0 - self.x_px : x1 - self.x_px]
            whole[place] = image[y0:y1, x0:x1]
        method = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(whole, (self.size_px, self.size_px), interpolation=method))


def whole_image(height_px: int, width_px: int, size_px: int) -> Square:
    """The smallest square around an image, which lies in its middle."""
    side = max(height_px, width_px)
    return Square(-((side - width_px) // 2), -((side - height_px) // 2), side, size_px)


def around(box_px: FloatArray, size_px: int, margin: float = 1.25) -> Square:
    """The square around a box's middle whose side is ``margin`` times the box's longer side."""
    x, y, width, height = np.asarray(box_px, np.float64)
    side = max(int(np.ceil(margin * max(width, height))), 8)
    return Square(
        int(np.floor(x + width / 2 - side / 2)), int(np.floor(y + height / 2 - side / 2)), side, size_px
    )


def grey(image: AnyArray) -> Float32Array:
    """(H, W) or (H, W, 3) uint8 or uint16 → (H, W) float32, 0 … 1.

    Raises:
        InputError: neither of these.
    """
    full_scale = {"uint8": 255, "uint16": 65535}.get(image.dtype.name)
    if full_scale is None or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise InputError(
            f"an image of shape {image.shape} and type {image.dtype} cannot be searched; give grey or"
            " red-green-blue of 8 or 16 bit"
        )
    plane = image if image.ndim == 2 else image @ np.array(_GREY_WEIGHTS)
    return np.asarray(plane / full_scale, dtype=np.float32)
