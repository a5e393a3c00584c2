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
_ROUNDS: Final = 6
"""Frames of a source for each worker; the first of each does not count."""
_PARTS: Final = ((30.0, 10.0, 60.0), (80.0, 10.0, 10.0))
"""Shares of the parts in two trainings: their difference leaves out what happens once, or once an
epoch."""
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
    picture_s = _learning(kitchen, probe)
    shutil.rmtree(probe)
    return Speeds(frame_s, opening_s, picture_s, time.monotonic() - started)


def _learning(kitchen: Kitchen, probe: Path) -> dict[str, float]:
    """Task → time to learn from one picture once."""
    recipe, registry = kitchen.recipe, kitchen.plugins.registry
    runs = [Dataset(probe / name) for name in recipe.data.sources]
    collect(runs, [], None, probe / DATA, lambda lines, total: lines)
    result = {}
    for task, choice in recipe.nets.items():
        registry.load("detector", choice.name)  # imports what would slow down the first training
        options = {**options_for(recipe, task, _EPOCHS, registry), "epochs": _EPOCHS}
        taken, pictures = [], []
        for number, parts in enumerate((_PARTS[0], *_PARTS)):  # the first prepares the libraries
            write_partition(Dataset(probe / DATA), parts, recipe.seed, "frame")
            dataset = Dataset(probe / DATA)
            began = time.monotonic()
            train(recipe, task, options, dataset, probe / f"{task}-{number}", registry)
            taken.append(time.monotonic() - began)
            pictures.append(_EPOCHS * max(len(pictures_for(task, dataset)), 1))
        more_s, more = taken[2] - taken[1], pictures[2] - pictures[1]
        least_s = _LEAST_OF_MEAN * taken[2] / pictures[2]
        result[task] = max(more_s / more if more > 0 else 0.0, least_s)
    return result
