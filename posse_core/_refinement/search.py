"""The search for the pose at which an image and a drawing agree, from starts and from what resembles
them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import Comparer, Comparison, LitComparer, ShapeComparer, sharpest
from posse_core._refinement.crop import Crop, Picture, Scale, scales
from posse_core._refinement.descent import Found, descended
from posse_core._refinement.light import APART_PX, Apart, Light, drawn_apart, fitted, together
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import is_near, prior
from posse_core._refinement.studio import EVEN, Studio
from posse_core._refinement.sunlight import brightest_direction
from posse_core._refinement.trail import (
    RIVAL,
    SAME,
    Outcome,
    Trail,
    by_chance,
    certainty,
    chance,
    different,
    size_fit,
    weighed,
)
from posse_core._refinement.turns import CLOSE, FAR, Around, Tried, half_turn_axes, half_turned, tilted

_STEPS = 4
_ROUNDS = 10
"""At each scale the light is fitted and so many steps are made, at most so many times."""
_LOOSE = 4.0
"""In the first of these rounds residuals may be so many times as large before they count no more."""
_SHAPE_STEPS = 10
_COARSE_PX = (48.0, 96.0)
_FOUND_PX = 1.0
"""By how many of a crop's pixels what is drawn may be beside what is seen, after steps."""
_BLUR_PX = 0.7
"""Blur of an image, until it is measured: that of POSSE's cameras by default."""
_SURE, _CLEAR = 0.95, 0.98
"""With the first agreement at the coarsest scale, poses nearby are not tried; with the second at the
finest, fewer rivals are followed."""
_HOPE = 0.15
"""How far the agreement may rise at finer scales."""
_TURNED, _SURPRISING = 5, 0.05
"""How many poses turned by half a turn are followed, and how much less likely they may be than other
rivals, as keypoints speak against them."""
_FOLLOWED, _MOST = 5, 10
"""So many rivals are followed to the finest scale, and until one agrees clearly at most so many."""
_LEAST_SUN = 2.0
"""Where the Sun is known, a plate that faces it is at least so many times as bright as one that faces
the brightest part of the sky: the Earth sends back a third of the Sun's light, and clouds half of it."""
_WALKS = 4
"""How often poses around the best of those around a pose are tried."""
_DOUBTFUL = 0.7
"""Poses that are less certain are sought in more places,"""
_SURE_START, _LEAST_START = 0.9, 0.01
"""but for those near a start that is trusted more, and where no start is trusted by so much."""
_WALKED, _TURNED_LATER, _SLIGHTLY = 6, 3, 2
"""Around so many starts, by half a turn from so many poses (and so many from each), and slightly turned
from so many."""


class Search:
    """The search in one image.

    Args:
        sun_direction_cam, box_px: as of :meth:`posse_core.Refiner.refine`.
        size_px: extent of the spacecraft in the finest crops.
        least_agreement: what is far below it at the coarsest scale is not followed.
        has_time: whether anything new may be begun.
    """

    def __init__(
        self,
        setting: RefinerSetting,
        studio: Studio,
        grey: Float32Array,
        sun_direction_cam: FloatArray | None,
        size_px: float,
        least_agreement: float,
        has_time: Callable[[], bool],
        box_px: FloatArray | None = None,
    ) -> None:
        self._studio, self._sun, self._has_time = studio, sun_direction_cam, has_time
        self._box_px = box_px
        self._followable = least_agreement - _HOPE
        vertices_m = np.concatenate([part.vertices_body_m for part in setting.spacecraft.parts])
        self._hull_m = studio.hull_m
        self._radius_m = setting.spacecraft.radius_m
        self._symmetries = setting.spacecraft.symmetries
        self._axes = half_turn_axes(vertices_m)
        self._starts: Sequence[PoseEstimate] = ()
        self._sizes_px = (*_COARSE_PX, size_px)
        self._by_coding = {
            linear: Picture(grey, setting.camera, box_px, is_linear=linear) for linear in (False, True)
        }
        self._picture = self._by_coding[False]

    def lit(self, starts: Sequence[PoseEstimate]) -> Outcome | None:
        """The pose by brightness; None where no start shows the spacecraft in the image.

        Args:
            starts: where to begin, and how likely each is.
        """
        self._starts = starts
        firsts = [Placement.of(start) for start in starts]
        coarse = [self._coarse(first, number) for number, first in enumerate(firsts)]
        trails = by_chance([trail for trail in coarse if trail is not None])
        if not trails:
            return None
        # Light that was found by a pose that is wrong says nothing of other poses.
        is_lit = self._sun is not None or trails[0].agreement > self._followable
        first_looks = self._first_looks(trails[0], firsts) if is_lit else []
        found = self._followed_to_the_finest([*trails, *first_looks])
        if found[0].agreement > self._followable and self._is_doubtful(found):
            found = self._compared([*found, *self._slightly_turned(found)])
            if self._is_doubtful(found) and found[0].agreement < _CLEAR:
                found += self._followed_to_the_finest(self._elsewhere(found, trails, firsts))
                found = self._compared(found)
                found = self._compared([*found, *self._slightly_turned(found)])
        best = found[0]
        self._picture = self._by_coding[best.is_linear]
        before = best.comparer.compare(firsts[best.start]).agreement
        return Outcome(best.found, before, best.start, certainty(found, self._symmetries))

    def _first_looks(self, best: Trail, firsts: Sequence[Placement]) -> list[Trail]:
        """Trails from poses that resemble the likeliest."""
        nearby: list[Trail] = []
        if best.agreement < _SURE:
            nearby = self._nearby(best, firsts[best.start], FAR)
        return nearby + self._half_turned(by_chance([best, *nearby])[0], _TURNED)

    def _elsewhere(
        self, found: Sequence[Trail], trails: Sequence[Trail], firsts: Sequence[Placement]
    ) -> list[Trail]:
        """Trails from poses that the first looks left out: near the other starts, and turned by half a
        turn from others than the likeliest.

        Args:
            found: those of the first looks, at the finest scale.
            trails: from the starts, at the coarsest scale, likeliest first.
            firsts: the starts.
        """
        more: list[Trail] = []
        for trail in trails[1:_WALKED]:
            if not any(each.agreement > _SURE for each in more):
                more += self._nearby(trail, firsts[trail.start], FAR)
        for trail in self._different([*found, *more])[:_TURNED_LATER]:
            more += self._half_turned(trail, _TURNED_LATER)
        return more

    def _is_doubtful(self, found: Sequence[Trail]) -> bool:
        """Whether the likeliest pose is little certain, and neither near a start that is sure nor from
        starts of which none may be right."""
        start, pose = self._starts[found[0].start], found[0].found.placement
        is_sure = start.trust > _SURE_START and is_near(pose, start, self._symmetries)
        is_possible = any(each.trust > _LEAST_START for each in self._starts)
        return certainty(found, self._symmetries) < _DOUBTFUL and is_possible and not is_sure

    def _slightly_turned(self, found: Sequence[Trail]) -> list[Trail]:
        """Trails from poses slightly turned from the likeliest at the finest scale, as steps end at any
        pose from which all small ones make the agreement less."""
        turned: list[Trail] = []
        for trail in found[:_SLIGHTLY]:
            turned += self._nearby(trail, trail.found.placement, CLOSE)
        return turned

    def _followed_to_the_finest(self, trails: Sequence[Trail]) -> list[Trail]:
        """The likeliest of trails, followed to the finest scale and compared there."""
        # What looks alike when it is coarse may not when it is fine.
        different = self._different(trails)
        rivals = [trail for trail in different if trail.chance > different[0].coarse_chance / RIVAL]
        finest: list[Trail] = []
        for trail in rivals[:_MOST]:
            is_clear = any(each.agreement > _CLEAR for each in finest)
            if is_clear and len(finest) >= _FOLLOWED:
                break
            finest.append(self._to_the_finest(trail))
        return self._compared(finest)

    def _compared(self, finest: Sequence[Trail]) -> list[Trail]:
        """Trails that differ at the finest scale, weighed against each other, the likeliest first."""
        alone = [replace(trail, share=1.0) for trail in finest]
        return by_chance(weighed(self._different(alone)))

    def _different(self, trails: Sequence[Trail]) -> list[Trail]:
        """Those that differ, most likely first; of several that are the same pose, the likeliest."""
        return different(trails, self._symmetries, SAME)

    def _to_the_finest(self, trail: Trail) -> Trail:
        """A trail through the scales, while its agreement may still become enough."""
        for scale in self._scales(trail.found.placement)[1:]:
            if not self._has_time() or trail.agreement < self._followable:
                break
            finer = self._followed(trail, scale)
            if finer is None:
                break
            trail = finer
        return trail

    def shape(self, start: PoseEstimate) -> Outcome | None:
        """The pose by outlines and creases, whatever the light; None where the start does not show the
        spacecraft in the image.

        Outlines are much the same from several sides: the pose is as certain as the start is trusted.
        """
        found, comparer = None, None
        here = first = Placement.of(start)
        for scale in self._scales(first):
            crop = self._picture.crop(here, self._hull_m, scale)
            if crop is None or not self._has_time():
                break
            comparer = ShapeComparer(crop, self._studio, _BLUR_PX)
            found = self._descended(comparer, crop, here, _SHAPE_STEPS)
            here = found.placement
        if found is None or comparer is None:
            return None
        return Outcome(found, comparer.compare(first).agreement, 0, start.trust)

    def _scales(self, placement: Placement) -> list[Scale]:
        return scales(self._picture.extent_px(placement, self._hull_m), self._sizes_px)

    def _coarse(self, first: Placement, number: int) -> Trail | None:
        """A start followed at the coarsest scale."""
        crops = self._crops(first, self._scales(first)[0])
        if not crops:
            return None
        sun = self._sun
        if sun is None:
            sun = brightest_direction(crops[0], self._studio, first, _BLUR_PX)
        return self._lit_at(crops, first, sun, None, number)

    def _crops(self, placement: Placement, scale: Scale) -> list[Crop]:
        """The part around the spacecraft, coded and linear; none if too little of it is in the image."""
        pictures = self._by_coding.values()
        crops = [picture.crop(placement, self._hull_m, scale) for picture in pictures]
        return [crop for crop in crops if crop is not None]

    def _half_turned(self, best: Trail, followed: int) -> list[Trail]:
        """So many trails from a pose turned by half a turn about axes across its principal ones, where
        they may rival it."""
        turned = half_turned(best.found.placement, self._axes)
        return [
            self._from(tried, best)
            for tried in self._drawn(best, turned, FAR.scale)[:followed]
            if tried.chance > _SURPRISING * best.coarse_chance / RIVAL and self._has_time()
        ]

    def _nearby(self, best: Trail, first: Placement, around: Around) -> list[Trail]:
        """Trails from poses around one: those that agree most, and so on from the best of these."""
        trails: list[Trail] = []
        here = first
        for _ in range(_WALKS):
            near = [here, *tilted(here, around)]
            found = [
                self._from(tried, best)
                for tried in self._drawn(best, near, around.scale)[: around.followed]
                if self._has_time()
            ]
            trails += found
            better = max(found, key=lambda trail: trail.chance, default=best)
            if better.chance <= best.chance or better.agreement > _SURE:
                break
            best, here = better, better.found.placement
        return trails

    def _drawn(self, best: Trail, placements: Sequence[Placement], scale: int) -> list[Tried]:
        """Poses under a trail's light, moved to where their drawings lie at one of the scales, the
        likeliest first."""
        sun = best.sun_direction_cam
        tried = []
        for placement in placements:
            crops = self._crops(placement, self._scales(placement)[scale])
            if crops and self._has_time():
                shown = drawn_apart(crops[0], self._studio, placement, sun)
                agreement, crop, light = self._coded(crops, shown, sun, _BLUR_PX, APART_PX)
                drawing = together(shown, light.lights)
                there = LitComparer(crop, self._studio, light).registered(drawing, placement)
                crops = self._crops(there.placement, self._scales(there.placement)[scale])
                if crops:
                    likely = chance(min(1.0, agreement + there.rise), self._prior(there.placement))
                    likely *= self._fit(there.placement)
                    tried.append(Tried(likely, crops, there.placement))
        return sorted(tried, key=lambda each: -each.chance)

    def _from(self, tried: Tried, best: Trail) -> Trail:
        """A pose that was drawn under a trail's light, followed at its scale."""
        return self._lit_at(tried.crops, tried.placement, best.sun_direction_cam, None, best.start)

    def _followed(self, trail: Trail, scale: Scale) -> Trail | None:
        """A trail at the next scale."""
        here = trail.found.placement
        crops = self._crops(here, scale)
        if not crops:
            return None
        sun = trail.sun_direction_cam
        if self._sun is None:
            crop = next(crop for crop in crops if crop.is_linear == trail.is_linear)
            sun = brightest_direction(crop, self._studio, here, trail.blur_px, sun)
        return self._lit_at(crops, here, sun, trail.blur_px, trail.start)

    def _lit_at(
        self,
        crops: Sequence[Crop],
        here: Placement,
        sun: FloatArray,
        blur_px: float | None,
        start: int,
    ) -> Trail:
        """Descend in a crop, fitting the light and the blur, and finding how the image is coded.

        A blur of None is not known yet, and is fitted after the first steps.
        """
        for number in range(_ROUNDS):
            shown = drawn_apart(crops[0], self._studio, here, sun)
            apart_px = APART_PX if number == 0 else _FOUND_PX
            _, crop, light = self._coded(
                crops, shown, sun, _BLUR_PX if blur_px is None else blur_px, apart_px
            )
            if blur_px is not None or number > 0:
                blur_px = sharpest(together(shown, light.lights), crop)
                light = replace(light, blur_px=blur_px)
            comparer = LitComparer(crop, self._studio, light)
            # A thin boom that is off by more than its width is far off in each of its pixels.
            looseness = _LOOSE if number == 0 else 1.0
            # An even sky is drawn together with the Sun as both are drawn apart.
            is_drawn = light.lights.sky_slope == EVEN
            first = comparer.compared(together(shown, light.lights), here) if is_drawn else None
            found = self._descended(comparer, crop, here, _STEPS, looseness, first)
            here = found.placement
            if (number > 0 and found.is_settled) or not self._has_time():
                break
        prior, fit = self._prior(here), self._fit(here)
        return Trail(found, comparer, sun, light.blur_px, crop.is_linear, start, prior, fit)

    def _prior(self, placement: Placement) -> float:
        """How likely a pose is by the starts."""
        return prior(placement, self._starts, self._symmetries)

    def _fit(self, placement: Placement) -> float:
        """What is left of a pose's chance, 0 … 1, by the detected box."""
        if self._box_px is None:
            return 1.0
        return size_fit(self._picture.share_of(placement, self._hull_m, self._box_px))

    def _coded(
        self,
        crops: Sequence[Crop],
        shown: Apart,
        sun: FloatArray,
        blur_px: float,
        apart_px: float,
    ) -> tuple[float, Crop, Light]:
        """Of crops of differently coded images, that which agrees most with what is drawn, how much, and
        the light in it."""
        least = 0.0 if self._sun is None else _LEAST_SUN
        lights = [fitted(crop, shown, sun, blur_px, apart_px, least) for crop in crops]
        agreements = [
            LitComparer(crop, self._studio, light).agreement(together(shown, light.lights))
            for crop, light in zip(crops, lights, strict=True)
        ]
        best = int(np.argmax(agreements))
        return agreements[best], crops[best], lights[best]

    def _descended(
        self,
        comparer: Comparer,
        crop: Crop,
        here: Placement,
        steps: int,
        looseness: float = 1.0,
        first: Comparison | None = None,
    ) -> Found:
        fx_px = crop.camera.fx_px / crop.scale.finer
        radius_px = fx_px * self._radius_m / max(float(here.t_body_cam_m[2]), 1e-3)
        begun = Found(here, comparer.compare(here) if first is None else first, radius_px)
        return descended(comparer, begun, self._radius_m, steps, self._has_time, looseness)
