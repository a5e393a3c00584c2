"""Following a recipe: from a spacecraft to two exported models, their accuracy and their card."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from pydantic import JsonValue

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import PARTITION_FILE
from posse_core._detection.groups import Group
from posse_core._files.atomic import sha256, write_json
from posse_core._files.reading import read_record
from posse_core._plugins.loading import Plugins
from posse_core._plugins.registry import Registry
from posse_core._recipe.budget import Decision, decide, epochs_in_time
from posse_core._recipe.card import write_card
from posse_core._recipe.data import DATA, Kitchen, make_data
from posse_core._recipe.judging import EVALUATION, Evaluation, judge
from posse_core._recipe.model import Recipe
from posse_core._recipe.probe import learning_of, measure, steady
from posse_core._recipe.scenarios import CRAFT, Scenarios
from posse_core._recipe.steps import Show, Steps
from posse_core._recipe.training import (
    MODEL,
    check_nets,
    check_start,
    export,
    options_for,
    pictures_for,
    train,
)
from posse_core._spacecraft.importing import imported, write_package
from posse_core._spacecraft.options import MeshOptions
from posse_core._spacecraft.package import DESCRIPTION
from posse_core._spacecraft.raw import unique_names
from posse_core._spacecraft.reader import read_mesh
from posse_core._view.picker.page import PICKER, picker_page

DECISION: Final = "decision.json"


def follow(recipe: Recipe, folder: Path, plugins: Plugins, show: Show) -> Group:
    """Follow a recipe in a folder. Steps that are done are left; one that was stopped is gone on with.

    Returns:
        The accuracy on all frames of the test part.

    Raises:
        InputError: a key is wrong, or the folder has steps of another recipe.
        ComponentError: a component failed.
    """
    registry = plugins.registry
    steps = Steps(folder, show)
    keys = recipe.model_dump(mode="json")
    check_nets(recipe, registry)
    check_start(recipe, registry)
    if recipe.refiner is not None:
        registry.options("refiner", recipe.refiner.name, recipe.refiner.options, where="refiner")
    if recipe.craft.name == "mesh":
        made = f"{CRAFT}/{DESCRIPTION}"
        steps.do(
            "import", {"craft": keys["craft"]}, CRAFT, made, partial(_import, recipe, folder, registry)
        )
    scenarios = Scenarios.of(recipe, folder, registry)
    kitchen = Kitchen(recipe, scenarios, plugins, show)
    decision = _decided(kitchen, keys, steps)
    show.expect(decision.expected_s)
    least_h = sum(decision.expected_s.values()) / 3600
    if recipe.hours is not None and least_h > recipe.hours:
        show.say(
            f"decision: even {sum(decision.frames.values())} frames take about {least_h:.2g} h, longer"
            f" than {recipe.hours:g} h; such nets will hardly have learned anything"
        )
    dataset = _data(kitchen, keys, decision, steps)
    show.say(f"{DATA}: {len(dataset)} frames, {len(dataset.part('test'))} for the test")
    epochs, models = _models(kitchen, decision, dataset, steps)
    steps.do(
        "evaluation",
        {"dataset": dataset.sha256, "refiner": keys["refiner"], **_digests(folder, recipe)},
        EVALUATION,
        EVALUATION,
        partial(judge, kitchen, dataset, folder, _end_s(recipe, steps)),
    )
    evaluation = read_record(folder / EVALUATION, Evaluation, "an evaluation of 'posse recipe'")
    write_card(folder, scenarios, decision, epochs, evaluation, dataset, steps.notes(), models)
    return evaluation.groups[0]


def _import(recipe: Recipe, folder: Path, registry: Registry) -> None:
    options = registry.options("scene", recipe.craft.name, recipe.craft.options, where="craft")
    assert isinstance(options, MeshOptions)
    placed: dict[str, Any] = {"mesh": folder / options.mesh}
    if options.keypoints is not None:
        placed["keypoints"] = folder / options.keypoints
    options = options.model_copy(update=placed)
    raw = read_mesh(options.mesh)
    found = imported(raw, options, unique_names([options.mesh.stem])[0])
    write_package(
        folder / CRAFT,
        options.mesh,
        found.craft,
        scale_m_per_unit=float(options.scale_m_per_unit or 1.0),  # that there is one was checked
        body_axes=options.body_axes,
        centre_of_mass_m=found.centre_of_mass_m,
        pages={PICKER: picker_page(found.craft, found.centre_of_mass_m)},
    )


def _decided(kitchen: Kitchen, keys: Mapping[str, Any], steps: Steps) -> Decision:
    path = steps.folder / DECISION

    def make() -> None:
        speeds = measure(kitchen, steps.folder) if kitchen.recipe.is_timed else None
        write_json(path, decide(kitchen.recipe, speeds).model_dump(mode="json"))

    of = {key: value for key, value in keys.items() if key != "refiner"}
    steps.do("decision", of, DECISION, DECISION, make)
    return read_record(path, Decision, "a decision of 'posse recipe'")


def _data(kitchen: Kitchen, keys: Mapping[str, Any], decision: Decision, steps: Steps) -> Dataset:
    frames: dict[str, JsonValue] = dict(decision.frames)
    of = {"craft": keys["craft"], "seed": keys["seed"], "data": keys["data"], "frames": frames}
    made = partial(make_data, kitchen, decision.frames, steps.folder)
    steps.do("frames", of, DATA, f"{DATA}/{PARTITION_FILE}", made)
    return Dataset(steps.folder / DATA)


def _models(
    kitchen: Kitchen, decision: Decision, dataset: Dataset, steps: Steps
) -> tuple[dict[str, int], list[Path]]:
    """Train and export the models: the epochs of each task, and the exported files in their order."""
    recipe, registry, folder = kitchen.recipe, kitchen.plugins.registry, steps.folder
    epochs: dict[str, int] = {}
    exported = []
    for task in recipe.nets:
        epochs[task] = _epochs(recipe, decision, task, dataset, steps, registry)
        options = options_for(recipe, task, epochs[task], registry)
        of: dict[str, JsonValue] = {
            "dataset": dataset.sha256,
            "detector": recipe.nets[task].name,
            "options": options,
            "start": recipe.start,
        }
        made = partial(train, recipe, task, options, dataset, folder / task, registry)
        steps.do(task, of, task, f"{task}/{MODEL}", made)
    for task in recipe.nets:
        model, out = folder / task / MODEL, folder / f"{task}.onnx"
        of = {"model": sha256(model)}
        steps.do(
            f"{task}.onnx", of, out.name, out.name, partial(export, model, task, dataset, out, registry)
        )
        exported.append(out)
    return epochs, exported


def _epochs(
    recipe: Recipe, decision: Decision, task: str, dataset: Dataset, steps: Steps, registry: Registry
) -> int:
    """The epochs of a training: those that it was begun with, or that now fit into the time, as fast as
    the machine is now."""
    if recipe.nets[task].options.get("epochs") is not None:
        return decision.epochs[task]
    note = steps.begun(task, task)
    if note is not None and isinstance(options := note.of["options"], dict):
        return int(str(options["epochs"]))
    began = time.monotonic()
    trial = partial(learning_of, recipe, task, dataset.folder, steps.folder, registry)
    learning = steady(trial, decision.learning(task))
    trial_s = time.monotonic() - began
    # A training that was removed to be made again has a note, whose time is no longer spent.
    tasks = list(recipe.nets)
    later = tasks[tasks.index(task) :]
    spent_s = sum(note.seconds for name, note in steps.notes().items() if name not in later)
    # To be measured by takes a picture about as long as to be learned from.
    pictures = sum(len(pictures_for(task, dataset, part)) for part in ("train", "valid"))
    fitting = epochs_in_time(recipe, decision, task, learning, pictures, spent_s + trial_s)
    training_s = learning.training_s(pictures, fitting)
    assert recipe.hours is not None  # as no epochs are given
    end_h = (spent_s + trial_s + training_s) / 3600
    if end_h > recipe.hours:
        steps.show.say(
            f"{task}: this machine has become slower, so {fitting} epochs, with fewer of which it would"
            f" hardly learn, end after about {end_h:.2g} h, later than {recipe.hours:g} h"
        )
    steps.show.expect({**decision.expected_s, task: training_s})
    return fitting


def _end_s(recipe: Recipe, steps: Steps) -> float:
    """When the recipe's hours will be over, in seconds of ``time.monotonic``; without hours, never."""
    if recipe.hours is None:
        return math.inf
    spent_s = sum(note.seconds for name, note in steps.notes().items() if name != "evaluation")
    return time.monotonic() + 3600 * recipe.hours - spent_s


def _digests(folder: Path, recipe: Recipe) -> dict[str, JsonValue]:
    """Task → digest of its model."""
    return {task: sha256(folder / task / MODEL) for task in recipe.nets}
