"""Poses on their way through the scales of a search, and how likely they are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._evaluation.poses import pose_errors
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.descent import Found

_LEAST_OFF = 1e-3
"""Edges never correlate more than by this less than 1."""
_COARSE_OFF = 0.02
"""The disagreement of the likeliest pose counts at least so much among others at the coarsest scale,
where different ones may agree nearly as much."""
RIVAL = 50.0
"""Poses whose chance is less by at most this factor may be the right one."""
UNSEEN_FROM_ALL_SIDES = 2.0
"""The chance of all poses that are left once looks from all sides were compared."""
_SCALE = 8.0
"""A pose of prior 1 that agrees by 0.65 has this chance, whatever the image's weight."""
_BOX_SIGMA = 0.2
"""Spread of the logarithm of the length of a pose's box over that of the detected one."""
_LARGER, _SMALLER = 0.1, 0.01
"""The least that is left of a pose's chance where its box is larger than the detected one, which may be
around what is lit alone, and where it is smaller."""
_EDGES, _POWER_OF_EDGES = 0.6, 4
"""A pose keeps its chance if its edges correlate so much with those of the image; below, the chance
falls with this power of what is left of 1."""


class Alike(NamedTuple):
    """Poses are alike that differ by less.

    Attributes:
        share: of the range, in position.
        angle_rad: in attitude.
    """

    share: float
    angle_rad: float


SAME = Alike(0.05, np.radians(5))
"""Such poses are the same."""
_OF_ONE_SIDE = Alike(0.15, np.radians(15))
"""Such rivals of a pose count once."""


class Weight(NamedTuple):
    """How much an image's disagreement with a drawing says against a pose.

    Attributes:
        power: of the disagreement with which the chance of a pose falls.
        least: what of a disagreement counts at least.
    """

    power: int
    least: float

    def chance(self, agreement: float, prior: float, least: float = 0.0) -> float:
        """How likely a pose is, among others, by how an image agrees with it and its prior.

        With the power 2, what is left of the disagreement counts as variance would.

        Args:
            least: what of the disagreement counts at least, where that is more.
        """
        off = max(1 - agreement, self.least, least)
        return float(prior * _SCALE ** (1 - self.power / 2) / off**self.power)


MATERIALS_KNOWN, MATERIALS_UNKNOWN = Weight(2, 1e-3), Weight(4, 0.05)
"""Where materials are not known, the true pose explains 0.7 to 0.9 and wrong ones 0.4 to 0.65, as
patterns that the mesh does not have are left at all poses alike. What explains more than 0.95 is no
likelier for it: a limb of the Earth is so plain that a panel explains it."""


class Telling(NamedTuple):
    """What an image tells of poses that were compared, and of those that were not.

    Attributes:
        odds: logarithm of the odds, for each standard deviation of the lead, that the pose which leaves
            less of the detail is the right one.
        unseen: the chance of all poses that were not tried.
        refused: what is left of a start's certainty if nothing near it agrees enough.
    """

    odds: float
    unseen: float
    refused: float


AS_DRAWN, ROUGHLY = Telling(1.5, 16.0, 0.3), Telling(0.6, 8.0, 0.7)
"""Where light and materials are known, or else. Where they are, a right pose agrees so much that it is
likely to have been left out if none does, and that it is hardly a start near which none does."""


@dataclass(frozen=True)
class Trail:
    """A pose on its way through the scales.

    Attributes:
        found: the pose and the comparison at it.
        comparer: that made the comparison.
        sun_direction_cam: (3,) where the light comes from.
        blur_px: of the image.
        is_linear: whether the image is; otherwise it is coded by sRGB.
        start: index of the start.
        prior: how likely the pose is before the image is compared.
        fit: what is left of its chance by the detected box and by edges.
        weight: of what the image disagrees with.
        share: of its chance that is left since others explain detail better.
    """

    found: Found
    comparer: LitComparer
    sun_direction_cam: FloatArray
    blur_px: float
    is_linear: bool
    start: int
    prior: float
    fit: float
    weight: Weight
    share: float = 1.0

    @property
    def agreement(self) -> float:
        return self.found.comparison.agreement

    @property
    def chance(self) -> float:
        """How likely the pose is among others."""
        return self.share * self.fit * self.weight.chance(self.agreement, self.prior)

    @property
    def coarse_chance(self) -> float:
        """The same, as far as the coarsest scale can tell."""
        return self.fit * self.weight.chance(self.agreement, self.prior, _COARSE_OFF)


@dataclass(frozen=True)
class Outcome:
    """What came of a search.

    Attributes:
        found: the pose and the comparison at it.
        agreement: of the image with it, at the scale at which poses were compared.
        before: the same at the start.
        start: index of the start.
        certainty: probability that no other pose is the right one, 0 … 1.
        certainty_among: the same if one of those that were compared is right.
    """

    found: Found
    agreement: float
    before: float
    start: int
    certainty: float
    certainty_among: float


def weighed(trails: Sequence[Trail], odds: float) -> list[Trail]:
    """Trails whose chance falls as others explain the image's detail better: brightness as a whole
    hardly tells poses that look alike, while edges and marks do.

    Args:
        odds: of :class:`Telling`.
    """
    if len(trails) < 2:
        return list(trails)
    first = trails[0]
    leads = [
        first.comparer.lead(first.found.placement, each.comparer, each.found.placement)
        for each in trails[1:]
    ]
    behind = [odds * lead for lead in (0.0, *leads)]
    return [
        replace(trail, share=math.exp(min(behind) - own))
        for trail, own in zip(trails, behind, strict=True)
    ]


class Likely(Protocol):
    """What has a chance."""

    @property
    def chance(self) -> float: ...


LikelyT = TypeVar("LikelyT", bound=Likely)


def by_chance(trails: Iterable[LikelyT]) -> list[LikelyT]:
    """Trails, or poses that were tried, the likeliest first."""
    return sorted(trails, key=lambda trail: -trail.chance)


def different(trails: Sequence[Trail], symmetries: Sequence[FloatArray], alike: Alike) -> list[Trail]:
    """Those that differ, the likeliest first; of several that are alike, the likeliest."""
    kept: list[Trail] = []
    for trail in by_chance(trails):
        pose = trail.found.placement
        errors = [pose_errors(*each.found.placement, *pose, symmetries) for each in kept]
        if not any(e_t < alike.share and e_q_rad < alike.angle_rad for e_t, e_q_rad in errors):
            kept.append(trail)
    return kept


def certainty(trails: Sequence[Trail], symmetries: Sequence[FloatArray], unseen: float) -> float:
    """Probability that the first of several trails, the likeliest, is the right one, 0 … 1, if all that
    was not tried has this chance.

    Where the image leaves a pose open, steps from several places end at as many poses, which are of one
    side of the spacecraft: only the likeliest of them rivals the first.
    """
    rivals = different(trails[1:], symmetries, _OF_ONE_SIDE)
    return trails[0].chance / (trails[0].chance + sum(trail.chance for trail in rivals) + unseen)


def size_fit(share: float) -> float:
    """What is left of the chance of a pose whose box in the image has this share of the length of the
    detected one's."""
    if share <= 0:
        return _SMALLER
    alike = float(np.exp(-((np.log(share) / _BOX_SIGMA) ** 2) / 2))
    return max(alike, _SMALLER if share < 1 else _LARGER)


def edge_fit(correlation: float) -> float:
    """What is left of the chance of a pose whose edges correlate so much, -1 … 1, with those of the
    image: gains and offsets explain clouds by whatever is drawn there, but their edges lie otherwise."""
    return float(min(1.0, (1 - _EDGES) / max(1 - correlation, _LEAST_OFF)) ** _POWER_OF_EDGES)
