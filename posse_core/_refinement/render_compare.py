"""The refiner ``render-compare``: draws the spacecraft, compares, corrects, coarse to fine."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._detection.square import to_grey
from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner, RefinerSetting
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Crop, Picture, scales
from posse_core._refinement.descent import Found, covariance, descended
from posse_core._refinement.light import Light, drawn_apart, fitted, together
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Studio
from posse_core._refinement.sunlight import brightest_direction

_STEPS = (4, 4, 4)
"""The most steps at each scale, the coarsest first."""
_ROUNDS = 3
_COARSE_PX = (48.0, 96.0)
_BLUR_PX = 0.7
"""Blur of an image, until it is measured: that of POSSE's cameras by default."""
_BLURS_PX = (0.0, 0.35, 0.5, 0.7, 0.9, 1.2, 1.6)
_GAIN = 0.002
"""By how much the agreement must rise."""


@dataclass(frozen=True)
class _Result:
    """What came of one start.

    Attributes:
        found: the pose and the comparison at it.
        before: agreement at the start, compared alike.
        start: the start.
    """

    found: Found
    before: float
    start: PoseEstimate

    @property
    def agreement(self) -> float:
        return self.found.comparison.agreement


class RenderCompare(Refiner[RenderCompareOptions]):
    """Compares the image with drawings of the spacecraft, and corrects the pose until they agree."""

    def __init__(self, options: RenderCompareOptions) -> None:
        super().__init__(options)
        self._setting: RefinerSetting | None = None
        self._studio: Studio | None = None

    def open(self, setting: RefinerSetting) -> None:
        """Prepare; renderers are opened when they are first needed."""
        self.close()
        craft = setting.spacecraft
        self._setting, self._studio = setting, Studio(setting, self.options.renderer)
        self._vertices_m = np.concatenate([part.vertices_body_m for part in craft.parts])
        self._radius_m = craft.radius_m

    def close(self) -> None:
        """Close the renderers."""
        if self._studio is not None:
            self._studio.close()
        self._setting = self._studio = None

    def refine(
        self,
        image: AnyArray,
        starts: Sequence[PoseEstimate],
        sun_direction_cam: FloatArray | None = None,
    ) -> Refinement:
        """Refine a pose; see :meth:`posse_core.Refiner.refine`."""
        setting, _ = self._opened()
        camera = setting.camera
        if image.shape[:2] != (camera.height_px, camera.width_px):
            raise InputError(
                f"refiner: the image has {image.shape[1]} × {image.shape[0]} pixels and the camera"
                f" {camera.width_px} × {camera.height_px}; give the camera that took it"
            )
        if not starts:
            raise InputError("refiner: there is no start pose")
        grey = to_grey(image)
        end_s = np.inf if self.options.ms is None else time.perf_counter() + self.options.ms / 1000

        def has_time() -> bool:
            return time.perf_counter() < end_s

        best: _Result | None = None
        for start in starts:
            made = self._from(start, grey, sun_direction_cam, has_time)
            if made is not None and (best is None or made.agreement > best.agreement):
                best = made
        if best is None:
            return Refinement(starts[0], False, 0.0, 0.0)
        is_better = (
            best.agreement >= self.options.least_agreement and best.agreement > best.before + _GAIN
        )
        pose = best.start
        if is_better:
            R, t = best.found.placement
            C = covariance(best.found.comparison, best.found.placement, self._radius_m)
            pose = replace(pose, R_cam_from_body=R, t_body_cam_m=t, covariance=C)
        return Refinement(pose, is_better, best.agreement, best.before)

    def _opened(self) -> tuple[RefinerSetting, Studio]:
        if self._setting is None or self._studio is None:
            raise ComponentError("render-compare: the refiner is not open")
        return self._setting, self._studio

    def _from(
        self,
        start: PoseEstimate,
        grey: Float32Array,
        sun_direction_cam: FloatArray | None,
        has_time: Callable[[], bool],
    ) -> _Result | None:
        setting, studio = self._opened()
        first = Placement.of(start)
        pictures = [Picture(grey, setting.camera, is_linear=is_linear) for is_linear in (False, True)]
        extent_px = pictures[0].extent_px(first, self._vertices_m)
        steps = scales(extent_px, (*_COARSE_PX, float(self.options.size_px)))
        crops = [picture.crop(first, self._vertices_m, steps[0]) for picture in pictures]
        if crops[0] is None or crops[1] is None:
            return None
        sun = sun_direction_cam
        if sun is None:
            sun = brightest_direction(crops[0], studio, first, _BLUR_PX)
        shown = drawn_apart(crops[0], studio, first, sun)
        agreements = []
        for crop in crops:
            assert crop is not None
            light = fitted(crop, shown, sun, _BLUR_PX)
            drawn = together(shown, light.lights)
            agreements.append(LitComparer(crop, studio, light).agreement(drawn))
        picture = pictures[int(np.argmax(agreements))]
        found: Found | None = None
        blur_px = _BLUR_PX
        here = first
        for scale, count in zip(steps, _STEPS, strict=False):
            crop = picture.crop(here, self._vertices_m, scale)
            if crop is None:
                return None
            if found is not None and sun_direction_cam is None:
                sun = brightest_direction(crop, studio, here, _BLUR_PX, sun)
            for _ in range(_ROUNDS):
                shown = drawn_apart(crop, studio, here, sun)
                light = fitted(crop, shown, sun, blur_px)
                if found is not None:
                    blur_px = _sharpest(crop, studio, light, together(shown, light.lights))
                    light = replace(light, blur_px=blur_px)
                comparer = LitComparer(crop, studio, light)
                found = descended(
                    comparer, here, self._radius_m, self._radius_px(here, crop), count, has_time
                )
                moved, here = here is not found.placement, found.placement
                if not moved:
                    break
            if not has_time():
                break
        assert found is not None
        return _Result(found, comparer.compare(first).agreement, start)

    def _radius_px(self, placement: Placement, crop: Crop) -> float:
        """The spacecraft's radius in pixels of a crop."""
        fx_px = crop.camera.fx_px / crop.scale.finer
        return fx_px * self._radius_m / max(float(placement.t_body_cam_m[2]), 1e-3)


def _sharpest(crop: Crop, studio: Studio, light: Light, drawn: Drawn) -> float:
    """The blur, px, with which what is drawn agrees best with the crop."""
    agreements = [
        LitComparer(crop, studio, replace(light, blur_px=blur_px)).agreement(drawn)
        for blur_px in _BLURS_PX
    ]
    return _BLURS_PX[int(np.argmax(agreements))]
