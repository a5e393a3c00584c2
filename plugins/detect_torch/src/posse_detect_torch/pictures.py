"""Frames of a dataset as small grey squares, which are cut once and cached in a file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from posse_core import AnyArray, Float32Array, LabelledImages, LabelLine, Square, to_grey

Choose = Callable[[LabelLine, int, int], Square]
"""Takes the label line, height and width of an image and returns the square to cut out."""


@dataclass(frozen=True)
class Pictures:
    """Squares cut from frames.

    Attributes:
        labels: the label line of each.
        squares: the position of each in its image.
        coded: (N, S, S) uint8, the square root of linear grey values, which resolves dark shades better.
    """

    labels: Sequence[LabelLine]
    squares: Sequence[Square]
    coded: AnyArray

    def __len__(self) -> int:
        return len(self.labels)

    def linear(self, position: int) -> Float32Array:
        """Return the square at a position: (S, S), 0 … 1, linear in radiance."""
        return np.asarray(np.square(self.coded[position].astype(np.float32) / 255))


def cut_pictures(
    dataset: LabelledImages,
    positions: Sequence[int],
    size_px: int,
    choose: Choose,
    folder: Path,
    name: str,
) -> Pictures:
    """Cut squares from frames, or map the file in ``folder`` if they were cut before."""
    labels = [dataset[i] for i in positions]
    squares = [choose(line, *dataset.size_px(i)) for line, i in zip(labels, positions, strict=True)]
    made_of = f"{dataset.sha256} {size_px} {list(positions)} {squares}"
    path = folder / f"{name}-{hashlib.sha256(made_of.encode()).hexdigest()[:12]}.npy"
    if not labels:
        return Pictures([], [], np.zeros((0, size_px, size_px), np.uint8))
    if not path.exists():
        unfinished = path.with_suffix(".part")
        shape = (len(labels), size_px, size_px)
        coded = np.lib.format.open_memmap(unfinished, mode="w+", dtype=np.uint8, shape=shape)
        for i, position in enumerate(tqdm(positions, f"{name}: cut", unit="frame", disable=None)):
            light = squares[i].cut(to_grey(dataset.image(position)))
            coded[i] = np.round(255 * np.sqrt(np.clip(light, 0, 1)))
        coded.flush()
        del coded
        unfinished.rename(path)
    return Pictures(labels, squares, np.load(path, mmap_mode="r", allow_pickle=False))
