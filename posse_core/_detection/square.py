"""Inputs of networks: grey squares of a fixed size, and conversions to and from the image's pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._interfaces.detector import Detection

KEYPOINT_MARGIN = 1.3
"""Side of the square divided by the side of the box; the margin allows for errors of the box."""


@dataclass(frozen=True)
class Square:
    """A square of an image that is scaled to the input of a network. It may extend beyond the image.

    Boxes are x, y, width, height, where x and y are the edges of the first pixel column and row. Points
    have the centre of the top-left pixel at (0, 0), both in the image and in the square.

    Attributes:
        x_px, y_px: left and top edge, in whole pixels of the image.
        side_px: side in pixels of the image.
        size_px: side after scaling.
    """

    x_px: int
    y_px: int
    side_px: int
    size_px: int

    @classmethod
    def of_image(cls, height_px: int, width_px: int, size_px: int) -> Self:
        """Return the smallest square that contains a whole image at its centre."""
        side = max(height_px, width_px)
        return cls(-((side - width_px) // 2), -((side - height_px) // 2), side, size_px)

    @classmethod
    def around(cls, box_px: FloatArray, size_px: int, margin: float = KEYPOINT_MARGIN) -> Self:
        """Return the square around a box's centre, as POSSE's keypoint networks take it.

        Args:
            box_px: (4,) x, y, width, height in the image.
            size_px: side after scaling.
            margin: side of the square divided by the longer side of the box.
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
        """Convert boxes (..., 4) x, y, width, height from the image to the square."""
        return (np.asarray(boxes_px, np.float64) - [self.x_px, self.y_px, 0, 0]) * self.scale

    def boxes_out(self, boxes_px: FloatArray) -> FloatArray:
        """Convert boxes (..., 4) x, y, width, height from the square to the image."""
        return np.asarray(boxes_px, np.float64) / self.scale + [self.x_px, self.y_px, 0, 0]

    def points_in(self, points_px: FloatArray) -> FloatArray:
        """Convert points (..., 2) from the image to the square; pixel centres are integers in both."""
        corner = np.array([self.x_px, self.y_px]) - 0.5
        return (np.asarray(points_px, np.float64) - corner) * self.scale - 0.5

    def points_out(self, points_px: FloatArray) -> FloatArray:
        """Convert points (..., 2) from the square to the image."""
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
        """Convert a network's outputs for the square to detections in the image, best first.

        Args:
            boxes_px: (K, 4) in the square. They are clipped to the image; empty ones are dropped.
            scores: (K,) 0 … 1; detections with score 0 are dropped.
            labels: (K,) indices into ``classes``; negative where there is no detection.
            classes: names of the classes.
            height_px, width_px: size of the image.
        """
        boxes = self.boxes_out(boxes_px)
        low = np.clip(boxes[:, :2], 0, [width_px, height_px])
        high = np.clip(boxes[:, :2] + boxes[:, 2:], 0, [width_px, height_px])
        whole = np.concatenate([low, high - low], axis=1)
        kept = (labels >= 0) & (scores > 0) & (whole[:, 2:] > 0).all(axis=1)
        order = np.argsort(-scores, kind="stable")
        return [Detection(classes[int(labels[i])], float(scores[i]), whole[i]) for i in order if kept[i]]

    def cut(self, image: AnyArray) -> Float32Array:
        """Cut the square out of a grey (H, W) image and scale it to (size, size).

        Pixels beyond the image's border are 0. Downscaling averages over areas.
        """
        height, width = image.shape
        x0, y0 = max(self.x_px, 0), max(self.y_px, 0)
        x1, y1 = min(self.x_px + self.side_px, width), min(self.y_px + self.side_px, height)
        whole = np.zeros((self.side_px, self.side_px), np.float32)
        if x1 > x0 and y1 > y0:
            inside = np.s_[y0 - self.y_px : y1 - self.y_px, x0 - self.x_px : x1 - self.x_px]
            whole[inside] = image[y0:y1, x0:x1]
        method = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(whole, (self.size_px, self.size_px), interpolation=method))
