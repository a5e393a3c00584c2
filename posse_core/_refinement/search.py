"""The search for the pose at which an image and a drawing agree, from starts and from what resembles
them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.descent import Found
from posse_core._refinement.follower import Follower
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import is_near
from posse_core._refinement.sides import Sides
from posse_core._refinement.trail import (
    RIVAL,
    SAME,
    UNSEEN_FROM_ALL_SIDES,
    Outcome,
    Trail,
    by_chance,
    certainty,
    different,
    weighed,
)
from posse_core._refinement.turns import BESIDE, CLOSE, FAR, Around, half_turn_axes, half_turned, tilted

_SURE, _CLEAR, _SETTLED = 0.95, 0.98, 0.99
"""With the first agreement at the coarsest scale, poses nearby are not tried; with the second at the
finest, fewer rivals are followed; with the third, poses slightly turned from there are not tried."""
_TURNED, _SURPRISING = 5, 0.05
"""How many poses turned by half a turn are followed, and how much less likely they may be than other
rivals, as keypoints speak against them."""
_FOLLOWED, _MOST = 5, 10
"""So many rivals are followed to the finest scale, and until one agrees clearly at most so many, where
the Sun's direction is known."""
_WALKS = 4
"""How often poses around the best of those around a pose are tried."""
_DOUBTFUL, _SOUGHT = 0.7, 0.9
"""Poses that are less certain than the first are sought in more places, and from all sides those that
are less certain than the second,"""
_SURE_START, _LEAST_START = 0.9, 0.01
"""but for those near a start that is trusted more, and where no start is trusted by so much."""
_WALKED, _TURNED_LATER, _SLIGHTLY = 6, 3, 2
"""Around so many starts, by half a turn from so many poses (and so many from each), and slightly turned
from so many."""
_ALIKE_FOLLOWED = 10
"""How many of the poses that look as the image does are followed."""


class Search:
    """The search in one image.

    Args:
        setting: of the refiner.
        follower: follows poses in the image.
        sides: looks of the spacecraft.
    """

    def __init__(self, setting: RefinerSetting, follower: Follower, sides: Sides) -> None:
        self._follower, self._sides = follower, sides
        vertices_m = np.concatenate([part.vertices_body_m for part in setting.spacecraft.parts])
        self._symmetries = setting.spacecraft.symmetries
        self._axes = half_turn_axes(vertices_m)
        self._is_sun_known = follower.sun_direction_cam is not None

    def lit(self, starts: Sequence[PoseEstimate], *, from_all_sides: bool) -> Outcome | None:
        """The pose by brightness; None where no start shows the spacecraft in the image.

        Args:
            starts: where to begin, and how likely each is.
            from_all_sides: whether a doubtful pose is sought from all sides, if the light is not known.
        """
        self._follower.starts = starts
        firsts = [Placement.of(start) for start in starts]
        coarse = [self._follower.coarse(first, number) for number, first in enumerate(firsts)]
        trails = by_chance([trail for trail in coarse if trail is not None])
        if not trails:
            return None
        # Light that was found by a pose that is wrong says nothing of other poses.
        is_lit = self._is_sun_known or trails[0].agreement > self._follower.followable
        first_looks = self._first_looks(trails[0], firsts) if is_lit else []
        looks: list[Trail] = []
        may_look = from_all_sides and not self._is_sun_known
        if may_look and self._is_doubtful(self._different([*trails, *first_looks]), _SOUGHT):
            looks = self._from_all_sides(by_chance([*trails, *first_looks])[0])
        found = self._followed_to_the_finest([*trails, *first_looks, *looks])
        # What agrees when it is coarse may not when it is fine.
        if may_look and not looks and self._is_doubtful(found, _SOUGHT):
            looks = self._from_all_sides(found[0])
            if looks:
                found = self._compared([*found, *self._followed_to_the_finest(looks)])
        is_hopeful = self._is_sun_known and found[0].agreement > self._follower.followable
        is_open = is_hopeful and found[0].agreement < _CLEAR
        # Where one half-turn was followed to its end and the other was not, detail tells nothing.
        if is_open or (looks and self._is_doubtful(found, _SOUGHT)):
            turned = self._followed_to_the_finest(self._half_turned(found[0], _TURNED_LATER))
            found = self._compared([*found, *turned])
        if is_hopeful and self._is_doubtful(found):
            found = self._compared([*found, *self._slightly_turned(found, CLOSE)])
            if self._is_doubtful(found) and found[0].agreement < _CLEAR:
                found += self._followed_to_the_finest(self._elsewhere(found, trails, firsts))
                found = self._compared(found)
                found = self._compared([*found, *self._slightly_turned(found, CLOSE)])
        elif is_hopeful and found[0].agreement < _SETTLED:
            beside = self._followed_to_the_finest(self._slightly_turned(_rivals(found), BESIDE))
            found = self._compared([*found, *beside])
        found, found_closer = self._compared_closer(found)
        best = found[0]
        self._follower.take_as(is_linear=best.is_linear)
        before = best.comparer.compare(firsts[best.start]).agreement
        unseen = UNSEEN_FROM_ALL_SIDES if looks else self._follower.telling.unseen
        others = unseen + self._follower.chance_of_nothing(best)
        sure, among = (certainty(found, self._symmetries, chance) for chance in (others, 0.0))
        return Outcome(found_closer, best.agreement, before, best.start, sure, among)

    def _first_looks(self, best: Trail, firsts: Sequence[Placement]) -> list[Trail]:
        """Trails from poses that resemble the likeliest."""
        nearby: list[Trail] = []
        # Where the Sun is not known, looks from all sides find more than poses nearby.
        if best.agreement < _SURE and self._is_sun_known:
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

    def _from_all_sides(self, best: Trail) -> list[Trail]:
        """Trails from poses that look as the image does in the detected box, however far from the
        starts.

        Args:
            best: the likeliest so far, from whose start they are said to come.
        """
        start = Placement.of(self._follower.starts[best.start])
        picture = self._follower.picture
        box_px = self._follower.box_px
        if box_px is None:
            box_px = picture.box_px(start, self._sides.hull_m)
        size_px, sun = self._follower.sizes_px[0], best.sun_direction_cam
        has_time, t_m = self._follower.has_time, start.t_body_cam_m
        alike = self._sides.resembling(picture, box_px, t_m, size_px, has_time)
        drawn = self._follower.drawn(alike.by_light, FAR.scale, sun)
        drawn += self._follower.drawn_along_edges(alike.by_edges, sun)
        return [
            self._follower.trail_from(tried, best.start)
            for tried in by_chance(drawn)[:_ALIKE_FOLLOWED]
            if self._follower.has_time()
        ]

    def _is_doubtful(self, found: Sequence[Trail], least: float = _DOUBTFUL) -> bool:
        """Whether the likeliest pose is less certain than this, and neither near a start that is sure
        nor from starts of which none may be right."""
        start, pose = self._follower.starts[found[0].start], found[0].found.placement
        is_sure = start.trust > _SURE_START and is_near(pose, start, self._symmetries)
        is_possible = any(each.trust > _LEAST_START for each in self._follower.starts)
        sure = certainty(found, self._symmetries, self._follower.telling.unseen)
        return sure < least and is_possible and not is_sure

    def _slightly_turned(self, found: Sequence[Trail], around: Around) -> list[Trail]:
        """Trails from poses slightly turned from the first of some, as steps end at any pose from which
        all small ones make the agreement less."""
        turned: list[Trail] = []
        for trail in found[:_SLIGHTLY]:
            turned += self._nearby(trail, trail.found.placement, around)
        return turned

    def _followed_to_the_finest(self, trails: Sequence[Trail]) -> list[Trail]:
        """The likeliest of trails, followed to the finest scale and compared there."""
        # What looks alike when it is coarse may not when it is fine.
        different = self._different(trails)
        rivals = [trail for trail in different if trail.chance > different[0].coarse_chance / RIVAL]
        finest: list[Trail] = []
        for trail in rivals[:_MOST]:
            is_clear = any(each.agreement > _CLEAR for each in finest)
            if len(finest) >= _FOLLOWED and (is_clear or not self._is_sun_known):
                break
            finest.append(self._follower.to_the_finest(trail))
        return self._compared(finest)

    def _compared(self, finest: Sequence[Trail]) -> list[Trail]:
        """Trails that differ at the finest scale, weighed against each other, the likeliest first."""
        alone = [replace(trail, share=1.0) for trail in finest]
        return by_chance(weighed(self._different(alone), self._follower.telling.odds))

    def _compared_closer(self, found: Sequence[Trail]) -> tuple[list[Trail], Found]:
        """Trails of which those that rival the likeliest are weighed anew by detail, where the image
        shows more of it, and where the likeliest leads there."""
        rivals = _rivals(found)
        closer = [self._follower.closer(trail) for trail in rivals]
        if len(rivals) > 1:
            told = weighed(closer, self._follower.telling.odds)
            rivals = [replace(trail, share=each.share) for trail, each in zip(rivals, told, strict=True)]
        best = max(range(len(rivals)), key=lambda place: rivals[place].chance)
        return by_chance([*rivals, *found[len(rivals) :]]), closer[best].found

    def _different(self, trails: Sequence[Trail]) -> list[Trail]:
        """Those that differ, most likely first; of several that are the same pose, the likeliest."""
        return different(trails, self._symmetries, SAME)

    def _half_turned(self, best: Trail, followed: int) -> list[Trail]:
        """So many trails from a pose turned by half a turn about axes across its principal ones, where
        they may rival it."""
        turned = half_turned(best.found.placement, self._axes)
        return [
            self._follower.trail_from(tried, best.start)
            for tried in self._follower.drawn(turned, FAR.scale, best.sun_direction_cam)[:followed]
            if tried.chance > _SURPRISING * best.coarse_chance / RIVAL and self._follower.has_time()
        ]

    def _nearby(self, best: Trail, first: Placement, around: Around) -> list[Trail]:
        """Trails from poses around one: those that agree most, and so on from the best of these."""
        trails: list[Trail] = []
        here = first
        sun = best.sun_direction_cam
        for _ in range(_WALKS):
            near = [here, *tilted(here, around)]
            found = [
                self._follower.trail_from(tried, best.start)
                for tried in self._follower.drawn(near, around.scale, sun)[: around.followed]
                if self._follower.has_time()
            ]
            trails += found
            better = max(found, key=lambda trail: trail.chance, default=best)
            if better.chance <= best.chance or better.agreement > _SURE:
                break
            best, here = better, better.found.placement
        return trails


def _rivals(found: Sequence[Trail]) -> list[Trail]:
    """The likeliest of trails, which comes first, and those of which one may be right in its place."""
    return [trail for trail in found if trail.chance >= found[0].chance / RIVAL]
