"""The dataset of a recipe: a run for each source, joined and divided into parts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from posse_core._dataset.dataset import Dataset
from posse_core._errors import ComponentError
from posse_core._interfaces.executor import FrameMade, FrameResult
from posse_core._model.label_line import LabelLine
from posse_core._plugins.loading import Plugins
from posse_core._recipe.model import Recipe
from posse_core._recipe.scenarios import Scenarios
from posse_core._recipe.steps import Show
from posse_core._run.plan import make_plan
from posse_core._run.run import run
from posse_core._selection.collect import collect
from posse_core._selection.partition import write_partition
from posse_core._selection.rules import Rule, named

DATA: Final = "data"
RUNS: Final = "runs"


@dataclass(frozen=True)
class Kitchen:
    """What all steps need.

    Attributes:
        recipe: that is followed.
        scenarios: of its sources.
        plugins: that are installed.
        show: shows how far it is.
    """

    recipe: Recipe
    scenarios: Scenarios
    plugins: Plugins
    show: Show


def make_frames(
    kitchen: Kitchen,
    name: str,
    frames: int,
    folder: Path,
    told: Callable[[float], None] = lambda at_s: None,
) -> None:
    """Make the frames of a source as a dataset in a folder, or go on with it.

    Args:
        told: is given the time (of ``time.monotonic``) at which each frame comes.

    Raises:
        ComponentError: frames could not be made.
        InputError: the folder holds another run.
    """
    registry, workers = kitchen.plugins.registry, kitchen.recipe.workers
    options = registry.options("executor", "local", {"workers": workers}, where="workers")
    plan = make_plan(kitchen.scenarios.scenario(name, frames), registry)

    def progress(
        results: Iterable[FrameResult[FrameMade]], total: int, done: int
    ) -> Iterable[FrameResult[FrameMade]]:
        for result in kitchen.show.bar(results, total - done, f"frames of {name}"):
            told(time.monotonic())
            yield result

    result = run(
        plan,
        str(folder),
        kitchen.plugins,
        registry.create("executor", "local", options),
        resume=True,
        progress=progress,
    )
    if result.failed:
        index, error = min(result.failed.items())
        raise ComponentError(
            f"{folder}: {len(result.failed)} of {frames} frames failed; frame {index}: {error}"
        )


def make_data(kitchen: Kitchen, frames: Mapping[str, int], folder: Path) -> None:
    """Make the frames of all sources, join them and divide them into parts; go on where it was stopped.

    Rules drop frames of the sources that show the spacecraft alone.

    Args:
        frames: source → number of its frames.
        folder: of :data:`RUNS` and :data:`DATA`.

    Raises:
        ComponentError: frames could not be made.
        InputError: there are other runs, or no frame is left.
    """
    recipe = kitchen.recipe
    data = folder / DATA
    if not data.exists():
        for name, count in frames.items():
            make_frames(kitchen, name, count, folder / RUNS / name)
        runs = [Dataset(folder / RUNS / name) for name in frames]
        rules = [_of_shown(rule, recipe) for rule in named(recipe.data.drop)]
        collect(runs, rules, None, data, lambda lines, total: kitchen.show.bar(lines, total, "joining"))
    write_partition(Dataset(data), recipe.data.split, recipe.seed, "frame")


def _of_shown(rule: Rule, recipe: Recipe) -> Rule:
    """A rule that keeps the frames of the sources without a spacecraft."""

    def drops(dataset: Dataset, labels: LabelLine) -> bool:
        return recipe.data.sources[dataset.folder.name].craft and rule.drops(dataset, labels)

    return replace(rule, why=f"{rule.why}, where the spacecraft is looked at", drops=drops)
