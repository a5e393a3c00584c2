"""Opening a pose detector from model files, for one spacecraft or for all that the models know."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from posse_core._detection.known import built_in_shapes, target_shapes
from posse_core._detection.models import open_models
from posse_core._detection.pose_detector import LEAST_SCORE, PoseDetector
from posse_core._errors import InputError
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice
from posse_core._simulator.scene import named_craft


def open_pose_detector(
    boxes: Path | None,
    keypoints: Path | None,
    registry: Registry,
    options: Mapping[str, Any],
    *,
    target: str | None = None,
    refiner: ComponentChoice | None = None,
    least_score: float = LEAST_SCORE,
    has_camera: bool = True,
) -> PoseDetector:
    """Open the models, and the meshes by which poses are improved.

    Args:
        boxes, keypoints, registry, options: as of :func:`open_models`.
        target: the only spacecraft to find: the name that the models give it, or the folder of its
            package; None finds all that they know.
        refiner: by which poses are refined; None refines none.
        least_score: detections below it are left out.
        has_camera: whether images come with their camera; without one there are no poses, and meshes
            need not be read.

    Raises:
        InputError: As of :func:`open_models`; or the models do not know the target.
    """
    package = None
    if target is not None and Path(target).is_dir():
        package = named_craft(target, registry)
        target = package.name
    wanted = () if target is None else (target,)
    found, finder = open_models(boxes, keypoints, registry, options, wanted)
    if target is not None and target not in found.classes:
        raise InputError(
            f"target {target}: the model knows {', '.join(found.classes)}; name one of them, or another"
            " model"
        )
    shapes = None
    if has_camera and package is not None:
        shapes = target_shapes(package, registry, refiner)
    elif has_camera:
        shapes = built_in_shapes(wanted or found.classes, registry, refiner)
    return PoseDetector(found, finder, least_score, shapes, target)
