"""Short trials of everything that takes time, from which follows how much fits into the hours."""

from __future__ import annotations

import contextlib
import io
import shutil
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from posse_core._arrays import evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._plugins.registry import Registry
from posse_core._recipe.budget import Speeds
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
"""The most frames to train on in two trainings: their difference leaves out what happens once, or once
an epoch. Both are whole batches, and the longer is many, since a training prepares a batch while it
learns from the one before."""
_EPOCHS: Final = 5
_LEAST_OF_MEAN: Final = 0.3
"""A picture takes at least this share of the mean over the longer training, however the shorter was
slowed down by other programs."""


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
    picture_s = {
        task: learning_s(kitchen.recipe, task, probe / DATA, folder, registry)
        for task in kitchen.recipe.nets
    }
    shutil.rmtree(probe)
    return Speeds(frame_s, opening_s, picture_s, time.monotonic() - started)


def learning_s(recipe: Recipe, task: str, data: Path, folder: Path, registry: Registry) -> float:
    """Return the time to learn from one picture once, s, by trials with a few frames of a dataset.

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
    options = {**options_for(recipe, task, _EPOCHS, registry), "epochs": _EPOCHS}
    taken, pictures = [], []
    for number, most in enumerate((_TAKEN[0], *_TAKEN)):  # the first prepares the libraries
        dataset = _Excerpt(data, most)
        began = time.monotonic()
        with _unseen():
            train(recipe, task, options, dataset, trial / str(number), registry)
        taken.append(time.monotonic() - began)
        pictures.append(_EPOCHS * max(len(pictures_for(task, dataset)), 1))
    shutil.rmtree(trial)
    more_s, more = taken[2] - taken[1], pictures[2] - pictures[1]
    least_s = _LEAST_OF_MEAN * taken[2] / pictures[2]
    return max(more_s / more if more > 0 else 0.0, least_s)


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
