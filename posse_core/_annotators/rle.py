"""COCO's compressed run-length code of a mask, as pycocotools and ``posse_core._formats.rle`` read it.

The runs go down the columns and begin with a run outside the mask. From the fourth on, a run is
stored as its difference to the one two before it. Each number is cut into groups of five bits, least
first, two's complement; bit 6 says that more follow, and 48 is added to make it a printable letter.
"""

from __future__ import annotations

import numpy as np

from posse_core._arrays import BoolArray, IntArray
from posse_core._model.camera import PixelBox


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
