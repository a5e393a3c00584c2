"""COCO's compressed run-length code of a mask, as pycocotools reads it.

The runs go down the columns and begin with a run outside the mask. From the fourth on, a run is
stored as its difference to the one two before it. Each number is cut into groups of five bits, least
first, two's complement; bit 6 says that more follow, and 48 is added to make it a printable letter.
"""

from __future__ import annotations

import numpy as np

from posse_core.model.arrays import BoolArray, IntArray
from posse_core.model.camera import PixelBox


def encode(mask: BoolArray, box: PixelBox, height_px: int, width_px: int) -> str:
    """Code a mask that is False outside a box.

    Args:
        mask: (box.height, box.width).
        box: where it lies in the image.
        height_px, width_px: of the image.
    """
    strip = np.zeros((box.width, height_px), dtype=np.bool_)
    strip[:, box.slices[0]] = mask.T
    inside = np.concatenate([[False], strip.ravel(), [False]])
    changes = np.flatnonzero(inside[1:] != inside[:-1]) + box.x0 * height_px
    total = height_px * width_px
    ends = np.concatenate([[0], changes, [total]])
    runs = np.diff(ends)
    return _letters(runs[:-1] if len(runs) > 1 and runs[-1] == 0 else runs)


def decode(counts: str, height_px: int, width_px: int) -> BoolArray:
    """(height, width) mask of a code.

    Raises:
        ValueError: not a code of an image of this size.
    """
    letters = np.frombuffer(counts.encode(), dtype=np.uint8).astype(np.int64) - 48
    whole = len(letters) > 0 and (letters >= 0).all() and (letters < 64).all() and letters[-1] < 32
    runs = _numbers(letters) if whole else np.array([-1])
    if (runs < 0).any() or runs.sum() != height_px * width_px:
        raise ValueError(f"the runs of a mask do not fill an image of {width_px} × {height_px} pixels")
    inside = np.arange(len(runs)) % 2 == 1
    return np.repeat(inside, runs).reshape(width_px, height_px).T


def _letters(runs: IntArray) -> str:
    left = runs.astype(np.int64)
    left[3:] -= runs[1:-2]
    groups: list[IntArray] = []
    written = [np.ones(len(runs), dtype=np.bool_)]
    while written[-1].any():
        group = left & 0x1F
        left = left >> 5
        # A number ends when what is left is but the sign that its highest written bit has.
        more = written[-1] & (left != np.where(group & 0x10, -1, 0))
        groups.append(group | np.where(more, 0x20, 0))
        written.append(more)
    letters = np.column_stack(groups)[np.column_stack(written[:-1])] + 48
    return bytes(letters.tolist()).decode("ascii")


def _numbers(letters: IntArray) -> IntArray:
    last = (letters & 0x20) == 0
    number = np.concatenate([[0], np.cumsum(last)[:-1]])
    starts = np.flatnonzero(np.concatenate([[True], last[:-1]]))
    place = np.arange(len(letters)) - starts[number]
    runs = np.add.reduceat((letters & 0x1F) << (5 * place), starts)
    width = 5 * (place[last] + 1)
    runs -= np.where(letters[last] & 0x10, np.left_shift(1, width), 0)
    for parity in (1, 2):
        runs[parity::2] = np.cumsum(runs[parity::2])
    return runs
