"""COCO's compressed run-lengths: a mask as text.

Runs of 0 and 1 alternate down the columns, beginning with 0. From the fourth on a run is stored as its
difference from the one two before; numbers are cut into groups of five bits, lowest first, each a
character from '0' on, with bit 5 set where more follow and the sign in the last one's bit 4.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, Strict

from posse_core._arrays import BoolArray

_Side = Annotated[int, Field(ge=0, strict=True)]


class RunLengths(BaseModel):
    """A mask in COCO's compressed run-lengths.

    Attributes:
        size: height and width of the image.
    """

    model_config = ConfigDict(frozen=True)

    size: tuple[_Side, _Side]
    counts: Annotated[str, Strict()]

    def mask(self) -> BoolArray:
        """(H, W) bool.

        Raises:
            ValueError: the runs do not fill the size.
        """
        height, width = self.size
        groups = np.frombuffer(self.counts.encode("ascii"), np.uint8).astype(np.int64) - 48
        last = (groups & 0x20) == 0
        if len(groups) == 0 or not last[-1] or groups.min() < 0:
            raise ValueError("the run lengths of the mask are damaged")
        first = np.concatenate([[0], np.flatnonzero(last)[:-1] + 1])
        lengths = np.diff(np.append(first, len(groups)))
        place = np.arange(len(groups)) - np.repeat(first, lengths)
        runs = np.add.reduceat((groups & 0x1F) << (5 * place), first)
        runs -= np.where(groups[last] & 0x10, 1 << (5 * lengths), 0)
        runs[1::2] = np.cumsum(runs[1::2])
        runs[2::2] = np.cumsum(runs[2::2])
        if runs.min() < 0 or runs.sum() != height * width:
            raise ValueError(f"the run lengths of the mask do not fill {width} x {height} pixels")
        values = np.arange(len(runs)) % 2 == 1
        return np.repeat(values, runs).reshape(width, height).T
