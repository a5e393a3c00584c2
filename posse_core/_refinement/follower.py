"""Poses followed from where they are tried to where an image and a drawing agree, from scale to
scale."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import Comparer, Comparison, LitComparer, ShapeComparer, sharpest
from posse_core._refinement.crop import Crop, Picture, Scale, scales
from posse_core._refinement.descent import Found, descended
from posse_core._refinement.light import (
    APART_PX,
    Apart,
    Light,
    drawn_apart,
    evenly_lit,
    fitted,
    together,
)
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import prior
from posse_core._refinement.studio import EVEN, Drawn, Studio
from posse_core._refinement.sunlight import brightest_direction, likely_direction
from posse_core._refinement.trail import (
    AS_DRAWN,
    MATERIALS_KNOWN,
    MATERIALS_UNKNOWN,
    ROUGHLY,
    Outcome,
    Trail,
    by_chance,
    edge_fit,
    size_fit,
)
from posse_core._refinement.turns import Tried

_STEPS = 4
_ROUNDS = 10
"""At each scale the light is fitted and so many steps are made, at most so many times."""
_LOOSE = 4.0
"""In the first of these rounds residuals may be so many times as large before they count no more."""
_SHAPE_STEPS = 10
_COARSE_PX = (48.0, 96.0)
_CLOSER = 2.0
"""The pose that is found is followed once more where the spacecraft is so many times as large as in the
finest crops, if the image shows it so."""
_FOUND_PX = 1.0
"""By how many of a crop's pixels what is drawn may be beside what is seen, after steps."""
_BLUR_PX = 0.7
"""Blur of an image, until it is measured: that of POSSE's cameras by default."""
_HOPE = 0.15
"""How far the agreement may rise at finer scales."""
_LEAST_SUN = 2.0
"""Where the Sun is known, a plate that faces it is at least so many times as bright as one that faces
the brightest part of the sky: the Earth sends back a third of the Sun's light, and clouds half of it."""


class _Seen(NamedTuple):
    """What would be seen at a pose under a light.

    Attributes:
        comparer: compares under this light.
        drawing: what would be seen.
        agreement: of the image with it.
    """

    comparer: LitComparer
    drawing: Drawn
    agreement: float


class Follower:
    """Follows poses in one image.

    Args:
        sun_direction_cam, box_px: as of :meth:`posse_core.Refiner.refine`.
        size_px: extent of the spacecraft in the finest crops.
        least_agreement: of a pose that is enough; what is far below it at the coarsest scale is not
            followed.
        has_time: whether anything new may be begun.

    Attributes:
        starts: by which poses are more and less likely.
        sun_direction_cam: as given.
        box_px: as given.
        followable: least agreement of what is followed to the next scale.
        has_time: as given.
        picture: the image, coded as was found last, and by sRGB until then.
        sizes_px: extents of the spacecraft in the crops, the coarsest first.
        telling: what the image tells of poses.
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
        box_px: FloatArray | None,
    ) -> None:
        self.starts: Sequence[PoseEstimate] = ()
        self.sun_direction_cam, self.has_time = sun_direction_cam, has_time
        self._least_agreement, self.followable = least_agreement, least_agreement - _HOPE
        self.sizes_px = (*_COARSE_PX, size_px)
        self._studio, self.box_px = studio, box_px
        self._radius_m = setting.spacecraft.radius_m
        self._symmetries = setting.spacecraft.symmetries
        self._weight = MATERIALS_KNOWN if studio.knows_materials else MATERIALS_UNKNOWN
        is_as_drawn = studio.knows_materials and sun_direction_cam is not None
        self.telling = AS_DRAWN if is_as_drawn else ROUGHLY
        self._by_coding = {
            linear: Picture(grey, setting.camera, box_px, is_linear=linear) for linear in (False, True)
        }
        self.picture = self._by_coding[False]

    def take_as(self, *, is_linear: bool) -> None:
        """Take the image's values to be linear in brightness, or else coded by sRGB."""
        self.picture = self._by_coding[is_linear]

    def coarse(self, first: Placement, number: int) -> Trail | None:
        """A start followed at the coarsest scale."""
        crops = self._crops(first, self.scales(first)[0])
        return self.trail_from(Tried(0.0, crops, first), number) if crops else None

    def drawn(self, placements: Sequence[Placement], scale: int, sun: FloatArray) -> list[Tried]:
        """Poses moved to where their drawings lie at one of the scales, the likeliest first.

        Args:
            sun: (3,) the direction of the Sun. Where it is not known, a direction that may be right: it
                is tried beside the likeliest one at each pose.
        """
        tried = []
        for placement in placements:
            crops = self._crops(placement, self._scale(placement, scale))
            if crops and self.has_time():
                moved = [
                    self._registered(seen, placement, scale)
                    for seen in self._seen_by(crops, placement, sun)
                ]
                tried += by_chance([each for each in moved if each is not None])[:1]
        return by_chance(tried)

    def drawn_along_edges(self, placements: Sequence[Placement], sun: FloatArray) -> list[Tried]:
        """Poses moved by outlines and creases at the coarsest scale, the likeliest first.

        Args:
            sun: as of :meth:`drawn`.
        """
        tried = []
        for placement in placements:
            crop = self.picture.crop(placement, self._studio.hull_m, self.scales(placement)[0])
            if crop is None or not self.has_time():
                continue
            comparer = ShapeComparer(crop, self._studio, _BLUR_PX)
            there = self._descended(comparer, crop, placement, _STEPS).placement
            crops = self._crops(there, self.scales(there)[0])
            if crops:
                seen = self._seen_by(crops, there, sun)
                tried += by_chance([self._tried(each, there, crops, 0.0) for each in seen])[:1]
        return by_chance(tried)

    def _seen_by(self, crops: Sequence[Crop], placement: Placement, sun: FloatArray) -> list[_Seen]:
        """A pose under a light and, where the Sun is not known, under the likeliest there."""
        even, suns = evenly_lit(crops[0], self._studio, placement), [sun]
        if self.sun_direction_cam is None:
            suns.append(likely_direction(crops[0], self._studio, even, _BLUR_PX))
        seen = []
        for each in suns:
            shown = drawn_apart(crops[0], self._studio, placement, each, even)
            agreement, crop, light = self._coded(crops, shown, each, _BLUR_PX, APART_PX)
            comparer = LitComparer(crop, self._studio, light)
            seen.append(_Seen(comparer, together(shown, light.lights), agreement))
        return seen

    def _registered(self, seen: _Seen, placement: Placement, scale: int) -> Tried | None:
        """A pose under a light, moved to where its drawing lies; None if too little of it is in the
        image there."""
        there = seen.comparer.registered(seen.drawing, placement)
        crops = self._crops(there.placement, self._scale(there.placement, scale))
        return self._tried(seen, there.placement, crops, there.rise) if crops else None

    def _tried(self, seen: _Seen, placement: Placement, crops: Sequence[Crop], rise: float) -> Tried:
        """A pose to which one under a light was moved, whereby the agreement has risen."""
        agreement = min(1.0, seen.agreement + rise)
        prior, fit = self._prior(placement), self._fit(placement, seen.comparer)
        return Tried(fit * self._weight.chance(agreement, prior), crops, placement)

    def trail_from(self, tried: Tried, start: int) -> Trail:
        """A pose that was drawn, followed at its scale."""
        sun = self.sun_direction_cam
        if sun is None:
            sun = brightest_direction(tried.crops[0], self._studio, tried.placement, _BLUR_PX)
        return self._lit_at(tried.crops, tried.placement, sun, None, start)

    def to_the_finest(self, trail: Trail) -> Trail:
        """A trail through the scales, while its agreement may still become enough."""
        for scale in self.scales(trail.found.placement)[1:]:
            if not self.has_time() or trail.agreement < self.followable:
                break
            finer = self._followed(trail, scale)
            if finer is None:
                break
            trail = finer
        return trail

    def closer(self, trail: Trail) -> Trail:
        """A trail that agrees enough, followed once more in a crop of more of the image's pixels, where
        it has more, if that crop agrees more with where it leads: of a photograph, it often shows
        nothing more."""
        here = trail.found.placement
        finest, closer = (
            scales(self.picture.extent_px(here, self._studio.hull_m), (size_px,))[0]
            for size_px in (self.sizes_px[-1], _CLOSER * self.sizes_px[-1])
        )
        is_enough = trail.agreement >= self._least_agreement
        if closer.binned == finest.binned or not is_enough or not self.has_time():
            return trail
        there = self._followed(trail, closer)
        if there is None:
            return trail
        return there if there.agreement > there.comparer.compare(here).agreement else trail

    def shape(self, start: PoseEstimate) -> Outcome | None:
        """The pose by outlines and creases, whatever the light; None where the start does not show the
        spacecraft in the image.

        Outlines are much the same from several sides: the pose is as certain as the start is trusted.
        """
        found, comparer = None, None
        here = first = Placement.of(start)
        for scale in self.scales(first):
            crop = self.picture.crop(here, self._studio.hull_m, scale)
            if crop is None or not self.has_time():
                break
            comparer = ShapeComparer(crop, self._studio, _BLUR_PX)
            found = self._descended(comparer, crop, here, _SHAPE_STEPS)
            here = found.placement
        if found is None or comparer is None:
            return None
        agreement = found.comparison.agreement
        return Outcome(found, agreement, comparer.compare(first).agreement, 0, start.trust, 1.0)

    def scales(self, placement: Placement) -> list[Scale]:
        return scales(self.picture.extent_px(placement, self._studio.hull_m), self.sizes_px)

    def _scale(self, placement: Placement, index: int) -> Scale:
        """The scale of an index, or the finest where an image of few pixels has fewer."""
        several = self.scales(placement)
        return several[min(index, len(several) - 1)]

    def _crops(self, placement: Placement, scale: Scale) -> list[Crop]:
        """The part around the spacecraft, coded and linear; none if too little of it is in the image."""
        pictures = self._by_coding.values()
        crops = [picture.crop(placement, self._studio.hull_m, scale) for picture in pictures]
        return [crop for crop in crops if crop is not None]

    def _followed(self, trail: Trail, scale: Scale) -> Trail | None:
        """A trail at the next scale."""
        here = trail.found.placement
        crops = self._crops(here, scale)
        if not crops:
            return None
        sun = trail.sun_direction_cam
        if self.sun_direction_cam is None:
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
            if (number > 0 and found.is_settled) or not self.has_time():
                break
        prior, fit = self._prior(here), self._fit(here, comparer)
        return Trail(
            found, comparer, sun, light.blur_px, crop.is_linear, start, prior, fit, self._weight
        )

    def chance_of_nothing(self, trail: Trail) -> float:
        """How likely it is, among poses, that there is no spacecraft where a trail ends: the background
        alone may explain what is seen there."""
        agreement = trail.comparer.agreement_of_background(trail.found.placement)
        return self._weight.chance(agreement, 1.0)

    def _prior(self, placement: Placement) -> float:
        """How likely a pose is by the starts."""
        return prior(placement, self.starts, self._symmetries)

    def _fit(self, placement: Placement, comparer: LitComparer) -> float:
        """What is left of a pose's chance, 0 … 1, by the detected box, and by edges where materials are
        not known."""
        by_edges = 1.0
        if not self._studio.knows_materials:
            by_edges = edge_fit(comparer.edge_correlation(placement))
        if self.box_px is None:
            return by_edges
        by_size = size_fit(self.picture.share_of(placement, self._studio.hull_m, self.box_px))
        return by_edges * by_size

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
        least = 0.0 if self.sun_direction_cam is None else _LEAST_SUN
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
        return descended(comparer, begun, self._radius_m, steps, self.has_time, looseness)
