"""COCO's compressed run-length code of a mask, as pycocotools and ``posse_core._formats.rle`` read it.

The runs go down the columns, and the first run is outside the mask. From the fourth run on, a run is
stored as its difference to the one two before it. Each number, in two's complement, is split into groups
of five bits, least significant first. A sixth bit says that more groups follow, and 48 is added to get a
printable letter.
"""

from __future__ import annotations

import numpy as np

from posse_core._arrays import BoolArray, IntArray
from posse_core._model.camera import PixelBox


def encode(mask: BoolArray, box: PixelBox, height_px: int, width_px: int) -> str:
    """Encode a mask that is False outside a box.

    Args:
        mask: (box.height, box.width).
        box: the part of the image that the mask covers.
        height_px, width_px: size of the image.
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
        # A number ends when the remaining bits only repeat the sign bit of the last group.
        more = written[-1] & (left != np.where(group & 0x10, -1, 0))
        groups.append(group | np.where(more, 0x20, 0))
        written.append(more)
    letters = np.column_stack(groups)[np.column_stack(written[:-1])] + 48
    return bytes(letters.tolist()).decode("ascii")
