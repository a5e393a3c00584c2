"""Images as nets see them: grey, square, of a fixed size; and the way back to the image's pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._errors import InputError
from posse_core._interfaces.detector import Detection

KEYPOINT_MARGIN = 1.3
"""Side of the square in sides of the box: room for points outside a box that is somewhat off."""
_GREY_WEIGHTS = (0.2126, 0.7152, 0.0722)  # ITU-R BT.709, linear light


@dataclass(frozen=True)
class Square:
    """A square of an image, scaled to what a net takes; it may reach beyond the image.

    Boxes are x, y, width, height, where x and y are edges: of the first pixel column and row. Points
    are pixel centres, the top-left one at (0, 0), in the image and in the square alike.

    Attributes:
        x_px, y_px: left and top edge, whole pixels of the image.
        side_px: its side in pixels of the image.
        size_px: its side after scaling.
    """

    x_px: int
    y_px: int
    side_px: int
    size_px: int

    @classmethod
    def of_image(cls, height_px: int, width_px: int, size_px: int) -> Self:
        """The smallest square around a whole image, which lies in its middle."""
        side = max(height_px, width_px)
        return cls(-((side - width_px) // 2), -((side - height_px) // 2), side, size_px)

    @classmethod
    def around(cls, box_px: FloatArray, size_px: int, margin: float = KEYPOINT_MARGIN) -> Self:
        """The square around a box's middle, which the keypoint nets of POSSE take.

        Args:
            box_px: (4,) x, y, width, height in the image.
            margin: its side in longer sides of the box.
        """
        x, y, width, height = np.asarray(box_px, np.float64)
        side = max(int(np.ceil(margin * max(width, height))), 8)
        left, top = int(np.floor(x + width / 2 - side / 2)), int(np.floor(y + height / 2 - side / 2))
        return cls(left, top, side, size_px)

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

    def detections_out(
        self,
        boxes_px: AnyArray,
        scores: AnyArray,
        labels: AnyArray,
        classes: Sequence[str],
        height_px: int,
        width_px: int,
    ) -> list[Detection]:
        """What a net found in the square, as detections in the image, best first.

        Args:
            boxes_px: (K, 4) in the square. They are cut at the image's border; empty ones are left out.
            scores: (K,) 0 … 1; those of 0 are left out.
            labels: (K,) indices into ``classes``; negative where there is no detection.
            height_px, width_px: of the image.
        """
        boxes = self.boxes_out(boxes_px)
        low = np.clip(boxes[:, :2], 0, [width_px, height_px])
        high = np.clip(boxes[:, :2] + boxes[:, 2:], 0, [width_px, height_px])
        whole = np.concatenate([low, high - low], axis=1)
        kept = (labels >= 0) & (scores > 0) & (whole[:, 2:] > 0).all(axis=1)
        order = np.argsort(-scores, kind="stable")
        return [Detection(classes[int(labels[i])], float(scores[i]), whole[i]) for i in order if kept[i]]

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


def to_grey(image: AnyArray) -> Float32Array:
    """An image as nets take it: grey, as a share of full scale.

    Args:
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16, linear light.

    Returns:
        (H, W) float32, 0 … 1; of colours the luminance of ITU-R BT.709.

    Raises:
        InputError: neither of these.
    """
    full_scale = {"uint8": 255, "uint16": 65535}.get(image.dtype.name)
    if full_scale is None or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise InputError(
            f"an image of shape {image.shape} and type {image.dtype} is not a camera's; give grey or"
            " red-green-blue of 8 or 16 bit"
        )
    plane = image if image.ndim == 2 else image @ np.array(_GREY_WEIGHTS)
    return np.asarray(plane / full_scale, dtype=np.float32)
