"""Where the light comes from, found in the image."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._frames import R_with_z
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Crop
from posse_core._refinement.flow import normals
from posse_core._refinement.light import APART_PX, Apart, fitted, together
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Lights, Studio

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
    scale, box = crop.scale.drawn, crop.drawn_box
    sky = studio.draw(scale, box, placement, Lights(0.0, 1.0, np.array([0.0, 0.0, -1.0])))
    facing = -normals(sky.depth_m, crop.camera, box)

    def agreement(direction: FloatArray, sun: Drawn) -> float:
        shown = Apart(sun, sky, facing)
        light = fitted(crop, shown, direction, blur_px, APART_PX)
        return LitComparer(crop, studio, light).agreement(together(shown, light.lights))

    def drawn(direction: FloatArray) -> float:
        return agreement(direction, studio.draw(scale, box, placement, Lights(1.0, 0.0, direction)))

    if near is None:
        everywhere = _everywhere()
        shaded = [agreement(each, _shaded(sky, facing, each)) for each in everywhere]
        tried = everywhere[np.argsort(shaded)[-_DRAWN:]]
    else:
        tried = near[None]
    found = [drawn(direction) for direction in tried]
    best = tried[int(np.argmax(found))]
    ring = _about(best, _RING_RAD[near is not None])
    around = [drawn(direction) for direction in ring]
    return np.asarray(ring[int(np.argmax(around))] if max(around) > max(found) else best)


def _shaded(sky: Drawn, facing: Float32Array, direction: FloatArray) -> Drawn:
    """What is drawn under an even sky, as light from a direction (3,) would shade it that casts no
    shadows, by normals (h, w, 3) towards the camera."""
    lit = np.maximum(0, facing @ direction.astype(np.float32))
    return Drawn(np.asarray(sky.bright * lit, np.float32), sky.coverage, sky.depth_m)


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
