"""A short trial of everything that takes time, from which follows how much fits into the hours."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Final

from posse_core._dataset.dataset import Dataset
from posse_core._recipe.budget import Speeds
from posse_core._recipe.data import DATA, Kitchen, make_frames
from posse_core._recipe.training import options_for, pictures_for, train
from posse_core._selection.collect import collect
from posse_core._selection.partition import write_partition

PROBE: Final = ".probe"
_ROUNDS: Final = 5
"""Frames of a source for each worker; the first of each does not count."""
_EPOCHS: Final = (1, 5)
"""Two trainings of so many epochs: the difference leaves out what happens once."""
_LEAST_OF_MEAN: Final = 0.3
"""An epoch takes at least this share of the mean over the longer training, however the first was slowed
down by other programs."""


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
    picture_s = _learning(kitchen, probe)
    shutil.rmtree(probe)
    return Speeds(frame_s, opening_s, picture_s, time.monotonic() - started)


def _learning(kitchen: Kitchen, probe: Path) -> dict[str, float]:
    """Task → time to learn from one picture once."""
    recipe, registry = kitchen.recipe, kitchen.plugins.registry
    runs = [Dataset(probe / name) for name in recipe.data.sources]
    collect(runs, [], None, probe / DATA, lambda lines, total: lines)
    dataset = Dataset(probe / DATA)
    write_partition(dataset, recipe.data.split, recipe.seed, "frame")
    result = {}
    for task, choice in recipe.nets.items():
        registry.load("detector", choice.name)  # imports what would slow down the first training
        taken = []
        for epochs in _EPOCHS:
            options = {**options_for(recipe, task, epochs, registry), "epochs": epochs}
            began = time.monotonic()
            train(recipe, task, options, dataset, probe / f"{task}-{epochs}", registry)
            taken.append(time.monotonic() - began)
        epoch_s = (taken[1] - taken[0]) / (_EPOCHS[1] - _EPOCHS[0])
        epoch_s = max(epoch_s, _LEAST_OF_MEAN * taken[1] / _EPOCHS[1])
        result[task] = epoch_s / max(len(pictures_for(task, dataset)), 1)
    return result
