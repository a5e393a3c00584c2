"""Short trials of everything that takes time, from which follows how much fits into the hours."""

from __future__ import annotations

import contextlib
import io
import shutil
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from posse_core._arrays import evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._plugins.registry import Registry
from posse_core._recipe.budget import Learning, Speeds
from posse_core._recipe.data import DATA, Kitchen, make_frames
from posse_core._recipe.model import Recipe
from posse_core._recipe.training import options_for, pictures_for, train
from posse_core._selection.collect import collect
from posse_core._selection.partition import write_partition

PROBE: Final = ".probe"
_TRIAL: Final = ".trial"
_ROUNDS: Final = 12
"""Frames of a source for each worker; the first of each does not count."""
_TAKEN: Final = (16, 144)
_EPOCHS: Final = (1, 6)
"""The most frames to train on, and the epochs, of four trainings. Their differences tell what happens
once, once an epoch, once for each picture, and whenever one is learned from. Frames are whole batches,
and the more are many, since a training prepares a batch while it learns from the one before."""
_MUCH_LONGER: Final = 1.25
_LEAST_OF_MEAN: Final = 0.3
"""To learn from a picture takes at least this share of the mean over the longest training, however the
shorter ones were slowed down by other programs."""


def measure(kitchen: Kitchen, folder: Path) -> Speeds:
    """Make a few frames of each source, and train on them for a few seconds.

    Args:
        folder: of the recipe; what is made in it is removed.

    Raises:
        ComponentError: frames could not be made, or a training failed.
    """
    probe = folder / PROBE
    shutil.rmtree(probe, ignore_errors=True)
    started = time.monotonic()
    workers = kitchen.recipe.workers
    frame_s, opening_s = {}, {}
    for name in kitchen.recipe.data.sources:
        begun, arrivals = time.monotonic(), list[float]()
        make_frames(kitchen, name, _ROUNDS * workers, probe / name, arrivals.append)
        first = arrivals[workers - 1]  # when each worker has made about one
        frame_s[name] = (arrivals[-1] - first) / (len(arrivals) - workers)
        opening_s[name] = max(first - begun - frame_s[name] * workers, 0.0)
    runs = [Dataset(probe / name) for name in kitchen.recipe.data.sources]
    collect(runs, [], None, probe / DATA, lambda lines, total: lines)
    write_partition(Dataset(probe / DATA), kitchen.recipe.data.split, kitchen.recipe.seed, "frame")
    registry = kitchen.plugins.registry
    learning = {
        task: learning_of(kitchen.recipe, task, probe / DATA, folder, registry)
        for task in kitchen.recipe.nets
    }
    shutil.rmtree(probe)
    return Speeds(frame_s, opening_s, learning, time.monotonic() - started)


def learning_of(recipe: Recipe, task: str, data: Path, folder: Path, registry: Registry) -> Learning:
    """Return how fast a net learns, by trials with a few frames of a dataset.

    Args:
        recipe: with the net of the task.
        task: boxes or keypoints.
        data: folder of a dataset with parts.
        folder: of the recipe; what is made in it is removed.
        registry: the installed components.

    Raises:
        ComponentError: a training failed.
    """
    trial = folder / _TRIAL
    shutil.rmtree(trial, ignore_errors=True)
    registry.load("detector", recipe.nets[task].name)  # imports what would slow down the first training

    def training_s(frames: int, epochs: int) -> float:
        options = {**options_for(recipe, task, epochs, registry), "epochs": epochs}
        began = time.monotonic()
        with _unseen():
            train(recipe, task, options, _Excerpt(data, frames), trial / f"{frames}-{epochs}", registry)
        return time.monotonic() - began

    (few, many), (once, often) = _TAKEN, _EPOCHS
    training_s(few, once)  # prepares the libraries
    shutil.rmtree(trial)
    taken_s = {(n, e): training_s(n, e) for e in _EPOCHS for n in _TAKEN}
    shutil.rmtree(trial)
    all_pictures = len(pictures_for(task, _Excerpt(data, many)))
    more = max(all_pictures - len(pictures_for(task, _Excerpt(data, few))), 1)
    by_once_s, by_often_s = (taken_s[many, e] - taken_s[few, e] for e in _EPOCHS)
    least_s = _LEAST_OF_MEAN * taken_s[many, often] / (often * max(all_pictures, 1))
    picture_s = max((by_often_s - by_once_s) / (more * (often - once)), least_s)
    return Learning(max(by_once_s / more - once * picture_s, 0.0), picture_s)


def steady(trial: Callable[[], Learning], before: Learning | None) -> Learning:
    """Return what a trial tells; where a net learns much slower than before, the faster of two. Whatever
    interrupts a short trial makes it longer, and a machine that has become slower is so twice.

    Args:
        trial: measures how fast a net learns.
        before: what was measured before; None if nothing was.
    """
    now = trial()
    if before is None or now.picture_s <= _MUCH_LONGER * before.picture_s:
        return now
    return min(now, trial(), key=lambda learning: learning.picture_s)


@contextlib.contextmanager
def _unseen() -> Iterator[None]:
    """Show nothing of a training, which would look like the one to come. Warnings are shown by that."""
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        yield


class _Excerpt(Dataset):
    """A dataset with a few frames to train on, and as few of the other parts in every trial: what they
    are measured for takes no longer the more is learned from."""

    def __init__(self, folder: Path, most: int) -> None:
        super().__init__(folder)
        self._most = most

    def part(self, name: str) -> list[int]:
        positions = super().part(name)
        most = self._most if name == "train" else _TAKEN[0]
        return [positions[i] for i in evenly_spread(len(positions), most)]
