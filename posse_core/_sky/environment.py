"""The sky as an environment map, for renderers."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.scene import EnvironmentMap
from posse_core._sky.earth import EarthView
from posse_core._sky.laboratory import Room

SHAPE = (64, 128)
"""Rows and columns."""
_LIMB_PX = 3
_LIMB_SAMPLES = 4
_INSIDE_SAMPLES = 2
"""The fewest samples, in each direction, of a pixel near the limb, and of one that is farther than so
many pixels within it."""
_ROOM_SAMPLES = 4


def environment_map(earth: EarthView) -> EnvironmentMap:
    """The Earth's radiance in all directions, camera axes.

    Every pixel is the mean over its solid angle, so the total light does not depend on the resolution.
    """
    rows, columns = SHAPE
    pixel_rad = np.pi / rows
    middles = _directions(
        np.cos(np.pi * (np.arange(rows)[:, None] + 0.5) / rows), np.arange(0.5, columns)
    )
    inside = earth.fills(middles, _LIMB_PX * pixel_rad)
    near_limb = earth.touches(middles, pixel_rad) & ~inside
    directions, widths_rad = [], []
    for which, least in ((inside, _INSIDE_SAMPLES), (near_limb, _LIMB_SAMPLES)):
        n = max(least, earth.samples(pixel_rad))
        row, column = np.nonzero(which)
        directions.append(_directions_within(row, column, n).reshape(-1, 3))
        widths_rad.append(np.full(len(directions[-1]), pixel_rad / n))
    # All are asked for at once, since a few take nearly as long as many.
    light = earth.light(np.concatenate(directions), np.concatenate(widths_rad))
    radiance_rgb = np.zeros((rows, columns, 3), dtype=np.float32)
    for which, seen in zip((inside, near_limb), np.split(light, [len(directions[0])]), strict=True):
        if len(seen):
            radiance_rgb[which] = seen.reshape(np.count_nonzero(which), -1, 3).mean(axis=1)
    return EnvironmentMap(radiance_rgb)


def room_map(room: Room) -> EnvironmentMap:
    """A laboratory's radiance in all directions, as :func:`environment_map`."""
    rows, columns = SHAPE
    row, column = (index.ravel() for index in np.indices(SHAPE))
    light = room.radiance_rgb(_directions_within(row, column, _ROOM_SAMPLES))
    return EnvironmentMap(light.mean(axis=(1, 2), dtype=np.float32).reshape(rows, columns, 3))


def _directions_within(row: IntArray, column: IntArray, n: int) -> FloatArray:
    """(P, n, n, 3) directions spread over the solid angle of each of (P,) pixels of the map."""
    steps = (np.arange(n) + 0.5) / n
    # Steps within a row are uniform in the cosine, so that every sample has the same solid angle.
    edges = np.cos(np.pi * np.arange(SHAPE[0] + 1) / SHAPE[0])
    cosines = edges[row, None] + np.diff(edges)[row, None] * steps
    return _directions(cosines[:, :, None], (column[:, None] + steps)[:, None])


def _directions(cosine: FloatArray, column: FloatArray) -> FloatArray:
    """Unit vectors, camera axes: cosines of the angle from the map's upper pole and positions along its
    rows, of shapes that broadcast to (...) → (..., 3)."""
    sine = np.sqrt(1 - cosine**2)
    phi = 2 * np.pi * column / SHAPE[1] - np.pi
    up = np.broadcast_to(-cosine, np.broadcast_shapes(cosine.shape, phi.shape))
    return np.stack([sine * np.sin(phi), up, sine * np.cos(phi)], axis=-1)
