"""The models of a recipe: training, and the speed of training."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from posse_core._arrays import evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.images import LabelledImages
from posse_core._detection.models import open_model, shipped_model
from posse_core._errors import InputError
from posse_core._evaluation.metrics import true_boxes
from posse_core._interfaces.detector import Model
from posse_core._plugins.registry import Registry
from posse_core._recipe.model import Recipe

MODEL: Final = "model.safetensors"
_COMPARED: Final = 8
"""Frames that go through a model and its export."""


def check_nets(recipe: Recipe, registry: Registry) -> None:
    """Check that the detectors do their tasks and can be trained and exported, and their options.

    Raises:
        InputError: a detector or an option is wrong.
    """
    for task, choice in recipe.nets.items():
        able = registry.spec("detector", choice.name).capabilities
        for wanted in (task, "train", "onnx"):
            if wanted not in able:
                fit = [
                    spec.name
                    for spec in registry.specs("detector")
                    if {task, "train", "onnx"} <= spec.capabilities
                ]
                raise InputError(
                    f"{task}: the detector {choice.name!r} has no capability {wanted!r}; there are"
                    f" {', '.join(fit) or 'none'}"
                )
        fields = registry.options_model("detector", choice.name).model_fields
        if "epochs" not in fields and recipe.hours is not None:
            raise InputError(
                f"{task}: the detector {choice.name!r} has no option 'epochs', by which its time is"
                " limited; choose another"
            )
        registry.options("detector", choice.name, choice.options, where=task)


def check_start(recipe: Recipe, registry: Registry) -> None:
    """Check that the nets are installed that the trainings start from.

    Raises:
        InputError: one is not.
    """
    if recipe.start is None:
        return
    for task in recipe.nets:
        try:
            shipped_model(task, [recipe.start], registry)
        except InputError as error:
            raise InputError(f"start: {error}, or set it to null") from None


def options_for(recipe: Recipe, task: str, epochs: int, registry: Registry) -> dict[str, Any]:
    """The options of a training, of those that the detector has."""
    choice = recipe.nets[task]
    derived: dict[str, Any] = {"epochs": epochs, "threads": recipe.workers, "seed": recipe.seed}
    known = registry.options_model("detector", choice.name).model_fields
    return {**{key: x for key, x in derived.items() if key in known}, **choice.options}


def pictures_for(task: str, dataset: Dataset, part: str = "train") -> list[int]:
    """The positions of the frames of a part that a task is learned from: keypoints from those that show
    some."""
    positions = dataset.part(part)
    if task == "boxes":
        return positions
    return [position for position in positions if true_boxes(dataset[position])]


def train(
    recipe: Recipe,
    task: str,
    options: Mapping[str, Any],
    dataset: LabelledImages,
    folder: Path,
    registry: Registry,
) -> None:
    """Train a model, or go on where it was stopped.

    Without an option ``start`` of its own it starts from the recipe's.

    Raises:
        InputError: the options or the net to start from do not fit the detector.
        ComponentError: the training failed.
    """
    name = recipe.nets[task].name
    start = None
    if recipe.start is not None and "start" in registry.options_model("detector", name).model_fields:
        start = shipped_model(task, [recipe.start], registry)
        options = {"start": str(start), **options}
    checked = registry.options("detector", name, options, where=task)
    model: Model = registry.create("detector", name, checked)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        model.train(dataset, folder)
    except InputError as error:
        if start is None or str(start) not in str(error):
            raise
        raise InputError(f"{error}; or set start to null in the recipe") from None


def export(model: Path, task: str, dataset: Dataset, out: Path, registry: Registry) -> None:
    """Export a model to ONNX and compare both on frames that are evenly spread."""
    positions = evenly_spread(len(dataset), _COMPARED).tolist()
    images = [dataset.image(position) for position in positions]
    open_model(model, task, registry, {}).export_onnx(out, images)
