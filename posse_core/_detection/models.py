"""Opening a model file with the component that reads it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from posse_core._detection.card import ModelCard
from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.detector import Detector, KeypointFinder, Model
from posse_core._plugins.registry import Registry
from posse_core._simulator.returned_detections import CheckedDetector, CheckedKeypointFinder

ONNX = ".onnx"
ENDINGS = ("model.safetensors", ONNX, ".safetensors")
"""Endings of model files, those that a user is likely to mean first."""
_TASK_OF = {"boxes": "finds boxes", "keypoints": "finds keypoints"}


def open_models(
    boxes: Path | None,
    keypoints: Path | None,
    registry: Registry,
    options: Mapping[str, Any],
    wanted: Collection[str] = (),
    *,
    in_flight: bool = False,
) -> tuple[Detector, KeypointFinder | None]:
    """Open a detector, and a finder of keypoints in its boxes.

    Args:
        boxes: model file; None takes the shipped model of a plugin.
        keypoints: model file; None means no keypoints, or the shipped model if ``boxes`` is None too.
        registry: the installed components.
        options: see :func:`open_detector`.
        wanted: names of the spacecraft that a shipped model should know.
        in_flight: take the first shipped model that knows them, to whose errors the defaults of
            navigators fit, and not the one of the fewest spacecraft.

    Raises:
        InputError: See :func:`open_detector`; or no installed plugin ships a model, or none that knows
            all that is wanted.
    """
    if boxes is None and keypoints is None:
        keypoints = shipped_model("keypoints", wanted, registry, in_flight=in_flight)
    boxes = boxes or shipped_model("boxes", wanted, registry, in_flight=in_flight)
    detector = open_detector(boxes, registry, options)
    if keypoints is None:
        return detector, None
    return detector, open_keypoint_finder(keypoints, registry, options)


def open_detector(path: Path, registry: Registry, options: Mapping[str, Any]) -> Detector:
    """Open the detector in a ``.safetensors`` or ``.onnx`` file.

    Args:
        path: the model file.
        registry: the installed components.
        options: of the component that reads it, as the user gave them.

    Raises:
        InputError: The file is missing, is not a POSSE model, does not find boxes, or no installed
            component reads it.
    """
    name, model = _opened(path, "boxes", registry, options)
    assert isinstance(model, Detector)  # as the capability asks
    return CheckedDetector(model, name)


def open_keypoint_finder(path: Path, registry: Registry, options: Mapping[str, Any]) -> KeypointFinder:
    """Open a model that finds keypoints; see :func:`open_detector`."""
    name, model = _opened(path, "keypoints", registry, options)
    assert isinstance(model, KeypointFinder)  # as the capability asks
    return CheckedKeypointFinder(model, name)


def open_model(path: Path, task: str, registry: Registry, options: Mapping[str, Any]) -> Model:
    """Open a model that does ``task``, without checks of what it returns; see :func:`open_detector`."""
    return _opened(path, task, registry, options)[1]


def shipped_model(
    task: str, wanted: Collection[str], registry: Registry, *, in_flight: bool = False
) -> Path:
    """The shipped model of the fewest spacecraft that knows all that are wanted; the first where none
    is, and in flight.

    Raises:
        InputError: No installed plugin ships a model, or none that knows all that is wanted.
        ComponentError: A detector names no shipped model, though it should.
    """
    known: dict[tuple[str, ...], Path] = {}
    for spec in registry.specs("detector"):
        if {"shipped", task} <= spec.capabilities:
            model: Model = registry.create(
                "detector", spec.name, registry.options("detector", spec.name, {})
            )
            if not model.shipped:
                raise ComponentError(
                    f"detector {spec.name!r} has the capability 'shipped', but names no shipped model"
                )
            known = {**model.shipped, **known}
    if not known:
        raise InputError(
            "no trained model is installed; give one with --model, or pip install posse-detect-onnx"
        )
    able = [names for names in known if set(wanted) <= set(names)]
    if not able:
        raise InputError(
            f"no shipped model finds {' and '.join(sorted(wanted))}; there are models of"
            f" {', '.join(' and '.join(names) for names in known)}; name a model of your own"
        )
    return known[min(able, key=len) if wanted and not in_flight else able[0]]


def check_model_file(path: Path) -> None:
    """Raise InputError if there is no file at the path; the message names one in a folder."""
    if path.is_dir():
        inside = [found for ending in ENDINGS for found in sorted(path.glob(f"*{ending}"))]
        hint = f"; name a file in it, such as {inside[0]}" if inside else " without a model file in it"
        raise InputError(f"{path}: is a folder{hint}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give a model made by 'posse train'")


def _opened(path: Path, task: str, registry: Registry, options: Mapping[str, Any]) -> tuple[str, Model]:
    """Return the name of the component that reads a file, and the component with the file's weights."""
    check_model_file(path)
    if path.suffix == ONNX:
        name = _onnx_reader(path, task, registry)
    else:
        card = ModelCard.read(path)
        name = card.net
        if card.task != task:
            raise InputError(
                f"{path}: this model {_TASK_OF[card.task]}, but one that {_TASK_OF[task]} is needed"
            )
    try:
        spec = registry.spec("detector", name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    model: Model = registry.create(
        "detector", name, registry.options("detector", name, options, where="option")
    )
    if task not in spec.capabilities:
        raise InputError(f"{path}: detector {name!r} has no capability {task!r}")
    model.load(path)
    return name, model


def _onnx_reader(path: Path, task: str, registry: Registry) -> str:
    for spec in registry.specs("detector"):
        if {ONNX, task} <= spec.capabilities:
            return spec.name
    raise InputError(f"{path}: no installed plugin reads it; pip install posse-detect-onnx")
