"""Textures with their coarser levels in one sheet, so that distant ground does not flicker."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import cv2
import numpy as np

from posse_core._arrays import AnyArray, Float32Array

MAX_LEVELS = 8
_ROW = 256
_MAX_SIDE = 32767
"""The most positions that OpenCV's remap takes in a row or column."""


def lookup(image: AnyArray, column: Float32Array, row: Float32Array) -> AnyArray:
    """Bilinear samples of an image (h, w[, c]) at positions of any shape → that shape [+ (c,)].

    Pixel centres are at whole numbers; outside the image its border pixels are repeated.
    """
    if column.ndim == 2 and max(column.shape) <= _MAX_SIDE:
        return _remapped(image, column, row)
    if column.ndim == 1 and 0 < column.size <= _MAX_SIDE:
        return np.asarray(_remapped(image, column[None], row[None])[0])
    # Positions of another shape are arranged in rows.
    count = column.size
    laid = np.zeros((2, -(-count // _ROW) * _ROW), dtype=np.float32)
    laid[0, :count], laid[1, :count] = column.ravel(), row.ravel()
    found = _remapped(image, *laid.reshape(2, -1, _ROW))
    return np.asarray(
        found.reshape(-1, *image.shape[2:])[:count].reshape(*column.shape, *image.shape[2:])
    )


def _remapped(image: AnyArray, column: Float32Array, row: Float32Array) -> AnyArray:
    return np.asarray(cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def area_mean(image: AnyArray) -> AnyArray:
    """(h, w[, c]) → (h // 2, w // 2[, c]) means."""
    h, w = image.shape[:2]
    return np.asarray(cv2.resize(image, (w // 2, h // 2), interpolation=cv2.INTER_AREA))


def _layout(
    shape: tuple[int, ...],
) -> tuple[list[tuple[int, int]], list[tuple[int, int]], tuple[int, int]]:
    """Shape of an image → (height, width) of its levels, their (x, y) on the sheet, and the sheet's
    height and width.

    Level 0 is at the top, and all others are in a row below it, each with a border of a pixel.
    """
    sizes = [(shape[0], shape[1])]
    while min(sizes[-1]) >= 32 and len(sizes) < MAX_LEVELS:
        sizes.append((sizes[-1][0] // 2, sizes[-1][1] // 2))
    beside = [0, *itertools.accumulate(width + 2 for _, width in sizes[1:])]
    corners = [(0, 0), *((x, sizes[0][0] + 2) for x in beside[:-1])]
    lower = sizes[1][0] + 2 if len(sizes) > 1 else 0
    return sizes, corners, (sizes[0][0] + 2 + lower, max(sizes[0][1] + 2, beside[-1]))


def _sheet(image: AnyArray, tiles: bool, halved: Callable[[AnyArray], AnyArray]) -> AnyArray:
    """The sheet of an image with all its levels."""
    sizes, corners, whole = _layout(image.shape)
    if image.ndim == 3 and image.shape[2] == 3:  # of four OpenCV takes samples in half the time
        image = np.concatenate([image, np.zeros_like(image[..., :1])], axis=2)
    sheet = np.zeros((*whole, *image.shape[2:]), dtype=image.dtype)
    for (x0, y0), (h, w) in zip(corners, sizes, strict=True):
        framed = sheet[y0 : y0 + h + 2, x0 : x0 + w + 2]
        framed[1:-1, 1:-1] = image
        framed[:, 0], framed[:, -1] = framed[:, -2], framed[:, 1]
        above, below = (-2, 1) if tiles else (1, -2)
        framed[0], framed[-1] = framed[above], framed[below]
        if (h, w) != sizes[-1]:
            image = halved(image)
    return sheet


class Pyramid:
    """An image and its coarser levels, each of half the resolution of the one before.

    The image repeats horizontally, and vertically too if it ``tiles``. Positions run from 0 to 1 over
    the image, from its top-left corner.
    """

    def __init__(
        self,
        image: AnyArray,
        tiles: bool = False,
        halved: Callable[[AnyArray], AnyArray] = area_mean,
    ) -> None:
        """image: (h, w) or (h, w, c) with up to 4 channels, uint8 or float32. ``halved`` makes the next
        level of one: half as high and wide, with what a pixel of that size sees."""
        self._lay_out(_sheet(image, tiles, halved), image.shape)

    @classmethod
    def kept(cls, sheet: AnyArray, shape: tuple[int, ...]) -> Pyramid:
        """The pyramid of an image of a shape from the ``sheet`` of one like it, as a cache has it.

        Raises:
            ValueError: the sheet is not of such an image.
        """
        pyramid = cls.__new__(cls)
        pyramid._lay_out(sheet, shape)
        return pyramid

    def _lay_out(self, sheet: AnyArray, shape: tuple[int, ...]) -> None:
        """Find the levels on the sheet of an image of a shape."""
        sizes, corners, whole = _layout(shape)
        if sheet.shape[:2] != whole:
            raise ValueError(f"the sheet has the shape {sheet.shape[:2]} instead of {whole}")
        self.sheet = sheet
        self._channels = shape[2] if len(shape) == 3 else 0
        # By axis and level.
        self._origin = np.array(corners, dtype=np.float32).T.copy() + np.float32(0.5)
        self._size = np.array(sizes, dtype=np.float32).T[::-1].copy()
        self._origin_step, self._size_step = np.diff(self._origin), np.diff(self._size)

    @property
    def width_px(self) -> int:
        """Width of the image at full resolution."""
        return int(self._size[0, 0])

    def at(self, x: Float32Array, y: Float32Array, level: Float32Array) -> Float32Array:
        """Bilinear samples at the nearest level: (...) positions and levels → ([c,] ...), float32."""
        first, last = np.clip(np.rint([level.min(), level.max()]), 0, self._size.shape[1] - 1).astype(
            int
        )
        origin, size = list(self._origin[:, first]), list(self._size[:, first])
        for finer in range(first, last):  # none, in most parts of an image
            coarser = level > np.float32(finer + 0.5)
            for axis in (0, 1):
                origin[axis] = origin[axis] + coarser * self._origin_step[axis, finer]
                size[axis] = size[axis] + coarser * self._size_step[axis, finer]
        column = origin[0] + x * size[0]
        row = origin[1] + y * size[1]
        found = lookup(self.sheet, column, row)
        if self._channels:
            found = np.moveaxis(found, -1, 0)[: self._channels]
        return np.ascontiguousarray(found, dtype=np.float32)

    def between(self, x: Float32Array, y: Float32Array, level: Float32Array) -> Float32Array:
        """As :meth:`at`, but also interpolated between levels, so that no steps are visible."""
        if level.max() <= 0:
            return self.at(x, y, level)
        level = np.clip(level, 0, self._size.shape[1] - 1)
        below = np.floor(level)
        found = self.at(x, y, below)
        found += (level - below) * (self.at(x, y, below + 1) - found)
        return found
