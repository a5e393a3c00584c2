"""Open a model file with the component that reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from posse_core.detection.card import read_card
from posse_core.errors import InputError
from posse_core.interfaces.detector import Detector, KeypointFinder, Model
from posse_core.registry import Registry

ONNX = ".onnx"
_TASK_OF = {"boxes": "finds boxes", "keypoints": "finds keypoints"}


def open_detector(path: Path, registry: Registry, options: Mapping[str, Any]) -> Detector:
    """The detector of a ``.safetensors`` or ``.onnx`` file, with its weights.

    Args:
        options: of the component that reads it, as the user gave them.

    Raises:
        InputError: missing, not a model of POSSE, not one that finds boxes, or nothing here reads it.
    """
    model = open_model(path, "boxes", registry, options)
    assert isinstance(model, Detector), f"{type(model)} claims the capability 'boxes'"
    return model


def open_keypoint_finder(path: Path, registry: Registry, options: Mapping[str, Any]) -> KeypointFinder:
    """As :func:`open_detector`, for a model that finds keypoints."""
    model = open_model(path, "keypoints", registry, options)
    assert isinstance(model, KeypointFinder), f"{type(model)} claims the capability 'keypoints'"
    return model


def open_model(path: Path, task: str, registry: Registry, options: Mapping[str, Any]) -> Model:
    """The model of a file, which must do ``task``; see :func:`open_detector`."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; name a model by 'posse train'")
    if path.suffix == ONNX:
        name = _onnx_reader(path, task, registry)
    else:
        card = read_card(path)
        name = card.net
        if card.task != task:
            raise InputError(
                f"{path}: it {_TASK_OF[card.task]}, where one that {_TASK_OF[task]} is needed"
            )
    model: Model = registry.create(
        "detector", name, registry.options("detector", name, options, where="option")
    )
    model.load(path)
    return model


def _onnx_reader(path: Path, task: str, registry: Registry) -> str:
    for spec in registry.specs("detector"):
        if {ONNX, task} <= spec.capabilities:
            return spec.name
    raise InputError(f"{path}: nothing that is installed reads it; pip install posse-detect-onnx")
