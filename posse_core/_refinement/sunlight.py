"""Where the light comes from, found in the image."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_with_z
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Crop
from posse_core._refinement.light import fitted, together
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Lights, Studio

_DIRECTIONS = 16
_FARTHEST_BEHIND = 0.6
"""Cosine of the smallest angle between the optical axis and the light behind the spacecraft."""
_RINGS_RAD = (0.35, 0.15)
_RING = 6
"""Directions in a ring about the best one, and the radii of the rings."""


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
    scale, box = crop.scale.drawn, crop.drawn_box
    sky = studio.draw(scale, box, placement, Lights(0.0, 1.0, np.array([0.0, 0.0, -1.0])))

    def agreement(direction: FloatArray) -> float:
        sun = studio.draw(scale, box, placement, Lights(1.0, 0.0, direction))
        light = fitted(crop, (sun, sky), direction, blur_px)
        drawn = together((sun, sky), light.lights)
        return LitComparer(crop, studio, light).agreement(drawn)

    tried = _everywhere() if near is None else near[None]
    found = [agreement(direction) for direction in tried]
    best, most = tried[int(np.argmax(found))], max(found)
    for radius_rad in _RINGS_RAD if near is None else _RINGS_RAD[1:]:
        ring = _about(best, radius_rad)
        found = [agreement(direction) for direction in ring]
        if max(found) > most:
            best, most = ring[int(np.argmax(found))], max(found)
    return np.asarray(best)


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
