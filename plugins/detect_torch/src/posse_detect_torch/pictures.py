"""Frames of a dataset as small grey squares, which are cut once and cached in a file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from tqdm import tqdm

from posse_core import (
    AnyArray,
    BodyLabels,
    Float32Array,
    LabelledImages,
    LabelLine,
    Square,
    seen_bodies,
    to_grey,
)

_BACKGROUNDS = 500
"""Of so many frames without a spacecraft, evenly spread, backgrounds are taken."""
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
        covered: (N, S, S) uint8, the share of each pixel that spacecraft cover, 255 for all of it, and
            for all pixels of a frame without masks, whose background then stays; None where masks were
            not asked for or no frame has some.
    """

    labels: Sequence[LabelsT]
    squares: Sequence[Square]
    coded: AnyArray
    covered: AnyArray | None

    def __len__(self) -> int:
        return len(self.labels)

    def linear(self, position: int) -> Float32Array:
        """Return the square at a position: (S, S), 0 … 1, linear in radiance."""
        return linear(self.coded[position])

    def coverage(self, position: int) -> Float32Array:
        """Return the share of each pixel (S, S) of the square that spacecraft cover, 0 … 1."""
        assert self.covered is not None
        return np.asarray(self.covered[position].astype(np.float32) / 255)


def linear(coded: AnyArray) -> Float32Array:
    """Return pictures linear in radiance, 0 … 1, from their code."""
    return np.asarray(np.square(coded.astype(np.float32) / 255))


def cut_pictures(
    dataset: LabelledImages,
    cuts: Sequence[Cut[LabelsT]],
    size_px: int,
    folder: Path,
    name: str,
    *,
    masks: bool = False,
    threads: int = 1,
) -> Pictures[LabelsT]:
    """Cut squares from frames, or map the files in ``folder`` if they were cut before.

    Args:
        masks: whether to cut the masks of all bodies too, where the labels have them.
        threads: so many frames are read at a time.
    """
    if not cuts:
        none = np.zeros((0, size_px, size_px), np.uint8)
        return Pictures([], [], none, None)
    coded = _cached(dataset, cuts, size_px, folder, name, lambda cut: _light(dataset, cut), threads)
    covered = None
    if masks and any(_has_masks(dataset[cut.position]) for cut in cuts):
        mask_name = f"{name}-covered"
        covered = _cached(
            dataset, cuts, size_px, folder, mask_name, lambda cut: _coverage(dataset, cut), threads
        )
    return Pictures([cut.labels for cut in cuts], [cut.square for cut in cuts], coded, covered)


def cut_backgrounds(dataset: LabelledImages, size_px: int, folder: Path, threads: int = 1) -> AnyArray:
    """Return what frames of the train part show that show no spacecraft: (N, S, S) uint8, coded as
    :attr:`Pictures.coded`; N may be 0."""
    empty = [i for i in dataset.part("train") if not seen_bodies(dataset[i])]
    chosen = [
        empty[i] for i in np.linspace(0, len(empty) - 1, min(len(empty), _BACKGROUNDS)).astype(int)
    ]
    cuts = [Cut(i, dataset[i], _middle(*dataset.size_px(i), size_px)) for i in chosen]
    return cut_pictures(dataset, cuts, size_px, folder, "backgrounds", threads=threads).coded


def _cached(
    dataset: LabelledImages,
    cuts: Sequence[Cut[LabelsT]],
    size_px: int,
    folder: Path,
    name: str,
    make: Callable[[Cut[LabelsT]], AnyArray],
    threads: int,
) -> AnyArray:
    """Return what is made of each cut, (N, S, S) uint8, from a file that is made where it is missing."""
    positions, squares = [cut.position for cut in cuts], [cut.square for cut in cuts]
    made_of = f"{dataset.sha256} {size_px} {positions} {squares}"
    path = folder / f"{name}-{hashlib.sha256(made_of.encode()).hexdigest()[:12]}.npy"
    if not path.exists():
        unfinished = path.with_suffix(".part")
        shape = (len(cuts), size_px, size_px)
        made = np.lib.format.open_memmap(unfinished, mode="w+", dtype=np.uint8, shape=shape)

        def fill(number: int) -> None:
            made[number] = make(cuts[number])

        with ThreadPoolExecutor(threads) as pool:
            filled = pool.map(fill, range(len(cuts)))
            for _ in tqdm(filled, f"{name}: cut", len(cuts), unit="frame", disable=None):
                pass
        made.flush()
        unfinished.rename(path)
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def _light(dataset: LabelledImages, cut: Cut[LabelsT]) -> AnyArray:
    light = cut.square.cut(to_grey(dataset.image(cut.position)))
    return np.asarray(np.round(255 * np.sqrt(np.clip(light, 0, 1))))


def _coverage(dataset: LabelledImages, cut: Cut[LabelsT]) -> AnyArray:
    whole = np.zeros(dataset.size_px(cut.position), np.float32)
    if not _has_masks(dataset[cut.position]):
        return np.full((cut.square.size_px, cut.square.size_px), 255)
    for body in seen_bodies(dataset[cut.position]).values():
        whole[body.mask_rle.mask()] = 1
    return np.asarray(np.round(255 * cut.square.cut(whole)))


def _has_masks(labels: LabelLine) -> bool:
    return all(body.has("mask_rle") for body in seen_bodies(labels).values())


def _middle(height_px: int, width_px: int, size_px: int) -> Square:
    """The largest square within an image, in its middle."""
    side = min(height_px, width_px)
    return Square((width_px - side) // 2, (height_px - side) // 2, side, size_px)
