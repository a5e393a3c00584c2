"""Where the light comes from, found in the image."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from posse_core._arrays import FloatArray
from posse_core._frames import R_with_z
from posse_core._refinement.background import near_pixels
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.light import (
    APART_PX,
    EvenlyLit,
    Light,
    averages,
    beside,
    drawn_apart,
    evenly_lit,
    fitted,
    together,
)
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Lights, Studio
from posse_core._refinement.windows import smooth

_DIRECTIONS, _DRAWN = 48, 3
"""Directions that are tried by Lambert's law alone, and how many of them are drawn."""
_FARTHEST_BEHIND = 0.6
"""Cosine of the smallest angle between the optical axis and the light behind the spacecraft."""
_RING_RAD, _RING = (0.2, 0.15), 6
"""Radius of a ring of directions about the best one, after all were tried and near a direction that is
known; and their number."""


def brightest_direction(
    crop: Crop,
    studio: Studio,
    placement: Placement,
    blur_px: float,
    near: FloatArray | None = None,
) -> FloatArray:
    """Find the direction (3,) from the spacecraft to its main light, camera axes, by which the crop
    agrees best with what is drawn.

    Args:
        near: a direction near which it is; None to look everywhere.
    """
    even = evenly_lit(crop, studio, placement)

    def drawn(direction: FloatArray) -> float:
        shown = drawn_apart(crop, studio, placement, direction, even)
        light = fitted(crop, shown, direction, blur_px, APART_PX)
        return LitComparer(crop, studio, light).agreement(together(shown, light.lights))

    if near is None:
        everywhere = _everywhere()
        shaded = _shaded(crop, studio, even, everywhere, blur_px)
        tried = everywhere[np.argsort(shaded)[-_DRAWN:]]
    else:
        tried = near[None]
    found = [drawn(direction) for direction in tried]
    best = tried[int(np.argmax(found))]
    ring = _about(best, _RING_RAD[near is not None])
    around = [drawn(direction) for direction in ring]
    return np.asarray(ring[int(np.argmax(around))] if max(around) > max(found) else best)


def likely_direction(crop: Crop, studio: Studio, even: EvenlyLit, blur_px: float) -> FloatArray:
    """The direction (3,) that :func:`brightest_direction` would try first: without shadows."""
    everywhere = _everywhere()
    shaded = _shaded(crop, studio, even, everywhere, blur_px)
    return np.asarray(everywhere[int(np.argmax(shaded))])


def _shaded(
    crop: Crop, studio: Studio, even: EvenlyLit, directions: FloatArray, blur_px: float
) -> FloatArray:
    """(N,) how much an image agrees with what is drawn under light from each direction (N, 3), as if it
    cast no shadows, and an even sky, of the strengths that leave least."""
    sky, facing = even
    lit = np.maximum(0, facing @ directions.T.astype(np.float32)) * sky.bright[..., None]
    blur, finer = blur_px * crop.scale.drawn, crop.scale.finer
    brights = [sky.bright, *np.ascontiguousarray(np.moveaxis(lit, -1, 0))]
    sharp = [binned(smooth(bright, blur), finer) for bright in brights]
    averaged = averages(crop, sky, sharp, blur_px, APART_PX)
    if averaged is None:
        return np.zeros(len(directions))
    seen, parts = averaged.seen * averaged.slope, averaged.parts * averaged.slope[:, None]
    background, near = beside(crop, sky, blur_px), near_pixels(sky, finer)
    comparer = LitComparer(crop, studio, Light(Lights(1.0, 1.0, directions[0]), blur_px))
    agreements = []
    for k in range(1, len(brights)):
        of_sky, of_sun = nnls(parts[:, [0, k]], seen)[0].astype(np.float32)
        modelled = crop.coded(background + of_sky * sharp[0] + of_sun * sharp[k])
        agreements.append(comparer.agreement_of(modelled, near))
    return np.array(agreements)


def _everywhere() -> FloatArray:
    """(N, 3) directions towards the camera and to the sides, evenly spread (Fibonacci's lattice)."""
    index = np.arange(_DIRECTIONS) + 0.5
    z = -1 + (1 + _FARTHEST_BEHIND) * index / _DIRECTIONS
    turn = index * np.pi * (3 - np.sqrt(5))
    side = np.sqrt(1 - z * z)
    return np.stack([side * np.cos(turn), side * np.sin(turn), z], axis=-1)


def _about(direction: FloatArray, radius_rad: float) -> FloatArray:
    """(N, 3) directions on a cone."""
    turn = np.arange(_RING) * 2 * np.pi / _RING
    cone = np.stack(
        [
            np.sin(radius_rad) * np.cos(turn),
            np.sin(radius_rad) * np.sin(turn),
            np.full(_RING, np.cos(radius_rad)),
        ],
        axis=-1,
    )
    return np.asarray(cone @ R_with_z(direction).T)
