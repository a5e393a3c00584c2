"""The search for the pose at which an image and a drawing agree, from starts and from what resembles
them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._frames import R_about
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import Comparer, LitComparer, ShapeComparer, sharpest
from posse_core._refinement.crop import Crop, Picture, Scale, scales
from posse_core._refinement.descent import Found, descended
from posse_core._refinement.light import drawn_apart, fitted, together
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Studio
from posse_core._refinement.sunlight import brightest_direction

_STEPS = 4
_ROUNDS = 3
"""At each scale the light is fitted and so many steps are made, at most so many times."""
_SHAPE_STEPS = 10
_COARSE_PX = (48.0, 96.0)
_BLUR_PX = 0.7
"""Blur of an image, until it is measured: that of POSSE's cameras by default."""
_SURE = 0.93
"""With this agreement at the coarsest scale nothing else is tried."""
_HOPE = 0.15
"""How far the agreement may rise at finer scales."""
_MARGIN = 0.04
"""By how much the agreement of a pose turned by half a turn must be greater."""
_PRIOR = 0.2
"""How much agreement the trust in a start is worth: what looks alike may agree better by chance."""
_CLOSE, _RIVALS = 0.15, 2
"""Other starts whose weighted agreement is so near to that of the best are followed too, at most so
many."""
_JITTER_RAD = np.radians(8)
_KEPT = 3
"""How many of the other poses are followed."""


@dataclass(frozen=True)
class Outcome:
    """What came of a search.

    Attributes:
        found: the pose and the comparison at it.
        before: agreement at the start, compared alike.
        start: index of the start.
    """

    found: Found
    before: float
    start: int

    @property
    def agreement(self) -> float:
        return self.found.comparison.agreement


@dataclass(frozen=True)
class _Trail:
    """A pose on its way through the scales.

    Attributes:
        found: the pose and the comparison at it.
        comparer: that made the comparison.
        sun_direction_cam: (3,) where the light comes from.
        blur_px: of the image.
        start: index of the start.
    """

    found: Found
    comparer: Comparer
    sun_direction_cam: FloatArray
    blur_px: float
    start: int

    @property
    def agreement(self) -> float:
        return self.found.comparison.agreement


class Search:
    """The search in one image.

    Args:
        sun_direction_cam: as of :meth:`posse_core.Refiner.refine`.
        size_px: extent of the spacecraft in the finest crops.
        has_time: whether anything new may be begun.
    """

    def __init__(
        self,
        setting: RefinerSetting,
        studio: Studio,
        grey: Float32Array,
        sun_direction_cam: FloatArray | None,
        size_px: float,
        has_time: Callable[[], bool],
    ) -> None:
        self._studio, self._sun, self._has_time = studio, sun_direction_cam, has_time
        self._vertices_m = np.concatenate([part.vertices_body_m for part in setting.spacecraft.parts])
        self._radius_m = setting.spacecraft.radius_m
        self._sizes_px = (*_COARSE_PX, size_px)
        self._codings = [Picture(grey, setting.camera, is_linear=linear) for linear in (False, True)]
        self._picture = self._codings[0]

    def lit(
        self, firsts: Sequence[Placement], trusts: Sequence[float], least_agreement: float
    ) -> Outcome | None:
        """The pose by brightness; None where no start shows the spacecraft in the image.

        Args:
            trusts: how likely each start is.
            least_agreement: what is far below it at the coarsest scale is not followed.
        """
        trails = []
        for number, first in enumerate(firsts):
            trail = self._coarse(first, number)
            if trail is not None:
                trails.append(trail)
        if not trails:
            return None

        def weight(trail: _Trail) -> float:
            return trail.agreement + _PRIOR * trusts[trail.start]

        trails.sort(key=weight, reverse=True)
        best = trails[0]
        # Light that was found by a pose that is wrong says nothing of other poses.
        is_worth_it = self._sun is not None or best.agreement > least_agreement - _HOPE
        if best.agreement < _SURE and is_worth_it and self._has_time():
            best = self._resembling(best, firsts[best.start], trusts[best.start])
        # What looks alike when it is coarse may not when it is fine.
        rivals = [trail for trail in trails[1:] if weight(trail) > weight(best) - _CLOSE][:_RIVALS]
        best = max(
            (self._to_the_finest(trail, least_agreement) for trail in (best, *rivals)), key=weight
        )
        before = best.comparer.compare(firsts[best.start]).agreement
        return Outcome(best.found, before, best.start)

    def _to_the_finest(self, trail: _Trail, least_agreement: float) -> _Trail:
        """A trail through the scales, while its agreement may still become enough."""
        for scale in self._scales(trail.found.placement)[1:]:
            if not self._has_time() or trail.agreement < least_agreement - _HOPE:
                break
            finer = self._followed(trail, scale)
            if finer is None:
                break
            trail = finer
        return trail

    def shape(self, first: Placement) -> Outcome | None:
        """The pose by outlines and creases, whatever the light; None where the start does not show the
        spacecraft in the image."""
        found, comparer = None, None
        here = first
        for scale in self._scales(first):
            crop = self._picture.crop(here, self._vertices_m, scale)
            if crop is None or not self._has_time():
                break
            comparer = ShapeComparer(crop, self._studio, _BLUR_PX)
            found = self._descended(comparer, crop, here, _SHAPE_STEPS)
            here = found.placement
        if found is None or comparer is None:
            return None
        return Outcome(found, comparer.compare(first).agreement, 0)

    def _scales(self, placement: Placement) -> list[Scale]:
        return scales(self._picture.extent_px(placement, self._vertices_m), self._sizes_px)

    def _coarse(self, first: Placement, number: int) -> _Trail | None:
        """A start followed at the coarsest scale, where it is also found how the image is coded."""
        scale = self._scales(first)[0]
        crops = [picture.crop(first, self._vertices_m, scale) for picture in self._codings]
        if crops[0] is None or crops[1] is None:
            return None
        sun = self._sun
        if sun is None:
            sun = brightest_direction(crops[0], self._studio, first, _BLUR_PX)
        shown = drawn_apart(crops[0], self._studio, first, sun)
        agreements = [self._agreement(crop, shown, sun) for crop in crops if crop is not None]
        if number == 0:
            self._picture = self._codings[int(np.argmax(agreements))]
        crop = self._picture.crop(first, self._vertices_m, scale)
        assert crop is not None
        return self._lit_at(crop, first, sun, _BLUR_PX, number, is_first=True)

    def _resembling(self, best: _Trail, first: Placement, trust: float) -> _Trail:
        """The best of a trail and of those from poses that look alike or are not far."""
        turns = [(_MARGIN + _PRIOR * trust, R_about(axis, np.pi)) for axis in np.eye(3)]
        turns += [(0.0, R_about(axis, sign * _JITTER_RAD)) for axis in np.eye(3) for sign in (-1, 1)]
        sun = best.sun_direction_cam
        tried: list[tuple[float, float, Crop, Placement]] = []
        for margin, turn in turns:
            placement = first.turned(turn)
            crop = self._picture.crop(placement, self._vertices_m, self._scales(placement)[0])
            if crop is None or not self._has_time():
                continue
            shown = drawn_apart(crop, self._studio, placement, sun)
            tried.append((self._agreement(crop, shown, sun) - margin, margin, crop, placement))
        most = best.agreement
        for _, margin, crop, placement in sorted(tried, key=lambda each: -each[0])[:_KEPT]:
            if self._has_time():
                trail = self._lit_at(crop, placement, sun, _BLUR_PX, best.start, is_first=True)
                if trail.agreement - margin > most:
                    best, most = trail, trail.agreement - margin
        return best

    def _followed(self, trail: _Trail, scale: Scale) -> _Trail | None:
        """A trail at the next scale."""
        here = trail.found.placement
        crop = self._picture.crop(here, self._vertices_m, scale)
        if crop is None:
            return None
        sun = trail.sun_direction_cam
        if self._sun is None:
            sun = brightest_direction(crop, self._studio, here, trail.blur_px, sun)
        return self._lit_at(crop, here, sun, trail.blur_px, trail.start, is_first=False)

    def _lit_at(
        self,
        crop: Crop,
        here: Placement,
        sun: FloatArray,
        blur_px: float,
        start: int,
        *,
        is_first: bool,
    ) -> _Trail:
        """Descend in a crop, fitting the light and, after the first steps, the blur."""
        for number in range(_ROUNDS):
            shown = drawn_apart(crop, self._studio, here, sun)
            light = fitted(crop, shown, sun, blur_px)
            if number > 0 or not is_first:
                blur_px = sharpest(together(shown, light.lights), crop)
                light = replace(light, blur_px=blur_px)
            comparer = LitComparer(crop, self._studio, light)
            found = self._descended(comparer, crop, here, _STEPS)
            has_moved, here = here is not found.placement, found.placement
            if not has_moved or not self._has_time():
                break
        return _Trail(found, comparer, sun, blur_px, start)

    def _agreement(self, crop: Crop, shown: tuple[Drawn, Drawn], sun: FloatArray) -> float:
        light = fitted(crop, shown, sun, _BLUR_PX)
        return LitComparer(crop, self._studio, light).agreement(together(shown, light.lights))

    def _descended(self, comparer: Comparer, crop: Crop, here: Placement, steps: int) -> Found:
        fx_px = crop.camera.fx_px / crop.scale.finer
        radius_px = fx_px * self._radius_m / max(float(here.t_body_cam_m[2]), 1e-3)
        return descended(comparer, here, self._radius_m, radius_px, steps, self._has_time)
