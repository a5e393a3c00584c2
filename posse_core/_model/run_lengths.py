"""COCO's compressed run-length code: a mask as text.

Runs of 0 and 1 alternate down the columns, beginning with a run of 0. From the fourth run on, a run is
stored as its difference to the one two before it. Each number is split into groups of five bits, least
significant first. A group is a character, counted from '0'; its bit 5 is set if more groups follow, and
bit 4 of the last group is the sign.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, Strict

from posse_core._arrays import BoolArray

_Side = Annotated[int, Field(ge=0, strict=True)]


class RunLengths(BaseModel):
    """A mask in COCO's compressed run-length code.

    Attributes:
        size: height and width of the image.
        counts: the run lengths, as text.
    """

    model_config = ConfigDict(frozen=True)

    size: tuple[_Side, _Side]
    counts: Annotated[str, Strict()]

    def mask(self) -> BoolArray:
        """Decode the mask: (H, W) bool.

        Raises:
            ValueError: the code is damaged, or the runs do not fill the image.
        """
        height, width = self.size
        groups = np.frombuffer(self.counts.encode("ascii"), np.uint8).astype(np.int64) - 48
        last = (groups & 0x20) == 0
        if len(groups) == 0 or not last[-1] or groups.min() < 0:
            raise ValueError("the run lengths of the mask are damaged")
        first = np.concatenate([[0], np.flatnonzero(last)[:-1] + 1])
        lengths = np.diff(np.append(first, len(groups)))
        index_in_number = np.arange(len(groups)) - np.repeat(first, lengths)
        runs = np.add.reduceat((groups & 0x1F) << (5 * index_in_number), first)
        runs -= np.where(groups[last] & 0x10, 1 << (5 * lengths), 0)
        runs[1::2] = np.cumsum(runs[1::2])
        runs[2::2] = np.cumsum(runs[2::2])
        if runs.min() < 0 or runs.sum() != height * width:
            raise ValueError(f"the run lengths of the mask do not fill {width} x {height} pixels")
        values = np.arange(len(runs)) % 2 == 1
        return np.repeat(values, runs).reshape(width, height).T
