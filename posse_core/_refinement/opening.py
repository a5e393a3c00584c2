"""Opening a refiner, and checks of what it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, array_fault
from posse_core._errors import ComponentError
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner, RefinerSetting
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.component import failures_named
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice, create
from posse_core._simulator.returned import CheckedRenderer

DEFAULT = "render-compare"
"""Name of the refiner that is used where none is named."""
_ORTHONORMAL = 1e-6
_ROUNDING = 1e-9


def open_refiner(
    registry: Registry, choice: ComponentChoice, spacecraft: Spacecraft, camera: Camera
) -> Refiner:
    """Open a refiner of a spacecraft, whose joints stay at zero, in the images of a camera.

    Raises:
        InputError: there is no such refiner, or an option is not valid.
        ComponentError: this machine lacks what it needs.
    """

    def renderer(name: str, options: Mapping[str, Any], scene: Scene) -> Renderer:
        made: Renderer = registry.create("renderer", name, registry.options("renderer", name, options))
        checked = CheckedRenderer(made, name)
        checked.open(scene)
        return checked

    refiner = CheckedRefiner(create(registry, "refiner", choice), choice.name)
    refiner.open(RefinerSetting(spacecraft.welded(()), camera, renderer))
    return refiner


class CheckedRefiner(Refiner):
    """A refiner whose results are checked."""

    def __init__(self, refiner: Refiner, name: str) -> None:
        super().__init__(refiner.options)
        self._refiner, self._name = refiner, name

    def open(self, setting: RefinerSetting) -> None:
        with failures_named("refiner", self._name):
            self._refiner.open(setting)

    def refine(
        self,
        image: AnyArray,
        starts: Sequence[PoseEstimate],
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Refinement:
        with failures_named("refiner", self._name):
            made = self._refiner.refine(image, starts, sun_direction_cam, box_px)
        fault = _fault(made, starts)
        if fault is not None:
            raise ComponentError(f"refiner {self._name!r}: {fault}")
        return made

    def close(self) -> None:
        self._refiner.close()


def _fault(made: object, starts: Sequence[PoseEstimate]) -> str | None:
    """What is wrong with a refinement, or None."""
    if not isinstance(made, Refinement):
        return f"it returned a value of type {type(made).__name__}, and must return a Refinement"
    for name in ("agreement", "agreement_before"):
        value = getattr(made, name)
        if not isinstance(value, float | int) or not 0 <= value <= 1:
            return f"{name} is {value!r}, and must be within 0 … 1"
    pose = made.pose
    if not made.is_better:
        is_start = any(pose is start for start in starts)
        return None if is_start else "the pose is not one of the starts, and is_better is False"
    shapes = {"R_cam_from_body": (3, 3), "t_body_cam_m": (3,), "covariance": (6, 6)}
    for name, shape in shapes.items():
        fault = array_fault(getattr(pose, name), shape, "floating")
        if fault is not None:
            return f"{name} {fault}"
    if not 0 <= pose.certainty <= 1:
        return f"certainty is {pose.certainty!r}, and must be within 0 … 1"
    R, C = pose.R_cam_from_body, pose.covariance
    if np.abs(R @ R.T - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(R) < 0:
        return "R_cam_from_body is no rotation"
    sigmas = np.sqrt(np.maximum(np.diag(C), 0))
    if not (sigmas > 0).all():
        return "the covariance has a variance that is not above 0"
    correlations = C / np.outer(sigmas, sigmas)
    if not np.allclose(C, C.T) or np.linalg.eigvalsh(correlations).min() < -_ROUNDING:
        return "the covariance is not symmetric with eigenvalues of 0 or more"
    return None
