"""Frames of a dataset as small grey squares, which are cut once and cached in a file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from tqdm import tqdm

from posse_core import AnyArray, BodyLabels, Float32Array, LabelledImages, Square, to_grey

LabelsT = TypeVar("LabelsT", bound=BodyLabels)
"""What a square is learned by: the label line of its frame, or the labels of one body in it."""


@dataclass(frozen=True)
class Cut(Generic[LabelsT]):
    """A square to cut from the frame at a position."""

    position: int
    labels: LabelsT
    square: Square


@dataclass(frozen=True)
class Pictures(Generic[LabelsT]):
    """Squares cut from frames.

    Attributes:
        labels: what each is learned by.
        squares: the position of each in its image.
        coded: (N, S, S) uint8, the square root of linear grey values, which resolves dark shades better.
    """

    labels: Sequence[LabelsT]
    squares: Sequence[Square]
    coded: AnyArray

    def __len__(self) -> int:
        return len(self.labels)

    def linear(self, position: int) -> Float32Array:
        """Return the square at a position: (S, S), 0 … 1, linear in radiance."""
        return np.asarray(np.square(self.coded[position].astype(np.float32) / 255))


def cut_pictures(
    dataset: LabelledImages, cuts: Sequence[Cut[LabelsT]], size_px: int, folder: Path, name: str
) -> Pictures[LabelsT]:
    """Cut squares from frames, or map the file in ``folder`` if they were cut before."""
    positions = [cut.position for cut in cuts]
    labels, squares = [cut.labels for cut in cuts], [cut.square for cut in cuts]
    made_of = f"{dataset.sha256} {size_px} {positions} {squares}"
    path = folder / f"{name}-{hashlib.sha256(made_of.encode()).hexdigest()[:12]}.npy"
    if not cuts:
        return Pictures([], [], np.zeros((0, size_px, size_px), np.uint8))
    if not path.exists():
        unfinished = path.with_suffix(".part")
        shape = (len(cuts), size_px, size_px)
        coded = np.lib.format.open_memmap(unfinished, mode="w+", dtype=np.uint8, shape=shape)
        for i, position in enumerate(tqdm(positions, f"{name}: cut", unit="frame", disable=None)):
            light = squares[i].cut(to_grey(dataset.image(position)))
            coded[i] = np.round(255 * np.sqrt(np.clip(light, 0, 1)))
        coded.flush()
        del coded
        unfinished.rename(path)
    return Pictures(labels, squares, np.load(path, mmap_mode="r", allow_pickle=False))
