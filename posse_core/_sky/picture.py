"""The Earth in an image: maps and clouds in every pixel, what varies smoothly only at nodes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray
from posse_core._model.camera import Camera, PixelBox
from posse_core._sky.atmosphere import RADIUS_M, TOP_M
from posse_core._sky.earth import EarthView
from posse_core._sky.surface import Surface

TOLERANCE = 3e-4
"""How far interpolated radiance may be off, per solar irradiance, sr⁻¹: 0.1 % of a white plate's."""
TOLERANCE_PX = 0.2
"""How far an interpolated position on the ground may be off."""
TOLERANCE_SHARE = 0.02
"""How far other interpolated numbers may be off, relative to their size."""
_TILE_PX = (64, 256)
"""Height and width of the parts that are drawn at once: few enough pixels for the processor's cache."""
_NODE_PX = 8
"""Distance of the nodes."""


def picture(
    earth: EarthView, camera: Camera, first_row: int, rows: int
) -> Iterator[tuple[PixelBox, Float32Array]]:
    """Boxes of some rows of an image, and the radiance (h, w, 3) of the Earth and its air in each.

    Angles, light and weather are computed at nodes and interpolated linearly between them. Where that
    would be wrong by more than the tolerances, as near the limb, they are computed in each pixel. If the
    Earth is only a few pixels wide, each is the mean of several rays.
    """
    boxes = _tiles(camera, earth, first_row, rows)
    samples = earth.samples(camera.pixel_rad)
    if samples > 1:
        yield from ((box, _sampled(earth, camera, box, samples)) for box in boxes)
        return
    # Tiles of one size have their nodes at the same positions and are prepared at once.
    for height, width in sorted({(box.height, box.width) for box in boxes}):
        same = [box for box in boxes if (box.height, box.width) == (height, width)]
        grid = _Grid(height, width)
        corners_px = np.array([[box.x0, box.y0] for box in same], dtype=np.float64)
        nodes_cam = camera.rays(corners_px[:, None, None] + grid.nodes_px)
        shape, pixel_rad = nodes_cam.shape[:3], camera.pixel_rad
        rays = earth.rays(nodes_cam, pixel_rad)
        surface = earth.surface(rays, np.arange(rays.ahead_m.size), pixel_rad)
        surface = surface.reshape(-1, *shape)
        usable = (rays.on_ground == 1).reshape(shape) & _smooth(surface)
        # No part of the Earth fits between nodes that are further from it than they are from each other.
        gap_m = 1.5 * _NODE_PX * pixel_rad * np.abs(rays.ahead_m)
        away = ((rays.nearest_m > RADIUS_M + TOP_M + gap_m) | (rays.ahead_m < 0)).reshape(shape)
        for i, box in enumerate(same):
            empty, inside = _cells(away[i]), _cells(usable[i])
            if empty.all():
                continue
            fields = grid.spread(surface[:, i])
            if inside.all():
                is_open_sea = earth.is_open_sea(Surface(surface[:, i]))
                light = earth.ground_light(Surface(fields), is_open_sea)
            else:
                light = _mixed(
                    earth, camera, box, fields, grid.by_pixel(inside), grid.by_pixel(~(inside | empty))
                )
            yield box, cv2.merge(list(light))


def _sampled(earth: EarthView, camera: Camera, box: PixelBox, samples: int) -> Float32Array:
    """(h, w, 3) radiance in a box, where each pixel is the mean of ``samples``² rays."""
    rays = camera.rays(box.pixel_centres_px())
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    v, u = np.nonzero(earth.touches(rays, camera.pixel_rad))
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    offsets_px = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    at_px = np.stack([u + box.x0, v + box.y0], axis=-1)[:, None] + offsets_px
    image = np.zeros((box.height, box.width, 3), dtype=np.float32)
    image[v, u] = earth.light(camera.rays(at_px), camera.pixel_rad / samples).mean(axis=1)
    return image


class _Grid:
    """Nodes of a tile, and linear interpolation between them."""

    def __init__(self, height: int, width: int) -> None:
        sides = (height, width)
        counts = [max(3, -(-side // _NODE_PX) + 1) for side in sides]
        down, across = (np.linspace(0, side - 1, n) for side, n in zip(sides, counts, strict=True))
        self.nodes_px: FloatArray = np.stack(np.meshgrid(across, down), axis=-1)
        """(m, n, 2) positions of the nodes in the tile; its corners are nodes."""
        at = [np.linspace(0, n - 1, side) for side, n in zip(sides, counts, strict=True)]
        rows, columns = (np.minimum(x.astype(np.intp), n - 2) for x, n in zip(at, counts, strict=True))
        self._cell = rows[:, None], columns
        hats = [
            np.maximum(0, 1 - np.abs(x[:, None] - np.arange(n))).astype(np.float32)
            for x, n in zip(at, counts, strict=True)
        ]
        self._down, self._right = hats[0], np.ascontiguousarray(hats[1].T)

    def spread(self, nodes: Float32Array) -> Float32Array:
        """(c, m, n) values at the nodes → (c, height, width) in the pixels."""
        return np.asarray(self._down @ (nodes @ self._right))

    def by_pixel(self, cells: BoolArray) -> BoolArray:
        """(m − 1, n − 1) of the cells between the nodes → (height, width) of the pixels in them."""
        return np.asarray(cells[self._cell])


def _mixed(
    earth: EarthView,
    camera: Camera,
    box: PixelBox,
    fields: Float32Array,
    inside: BoolArray,
    traced: BoolArray,
) -> Float32Array:
    """(3, h, w) radiance of a tile (Surface.COUNT, h, w), of which a part is traced.

    ``inside`` and ``traced`` (h, w) are the pixels whose fields hold, and those to be computed one by
    one. There is no light from the others.
    """
    light = np.zeros((3, box.height, box.width), dtype=np.float32)
    v, u = np.nonzero(traced)
    rays = earth.rays(camera.rays(np.stack([u + box.x0, v + box.y0], axis=-1)), camera.pixel_rad)
    light[:, v, u] = earth.air_light(rays, camera.pixel_rad).T
    known = fields[:, inside]
    ground = np.flatnonzero(rays.on_ground > 0)
    if Surface(fields).is_dark or not known.size + ground.size:  # nothing to compute, as by night
        return light
    if ground.size:
        known = np.concatenate([known, earth.surface(rays, ground, camera.pixel_rad)], axis=1)
    of_ground = earth.ground_light(Surface(known))
    smooth = known.shape[1] - ground.size
    light[:, inside] = of_ground[:, :smooth]
    light[:, v[ground], u[ground]] += rays.on_ground[ground] * of_ground[:, smooth:]
    return light


def _tiles(camera: Camera, earth: EarthView, first_row: int, rows: int) -> list[PixelBox]:
    """Tiles of some rows of the image that the Earth may touch."""
    down, across = (
        np.linspace(0, whole, -(-whole // side) + 1).round().astype(int).tolist()
        for whole, side in zip((rows, camera.width_px), _TILE_PX, strict=True)
    )
    boxes = [
        PixelBox(x0, first_row + y0, x1 - x0, y1 - y0)
        for y0, y1 in itertools.pairwise(down)
        for x0, x1 in itertools.pairwise(across)
    ]
    middles_px = [(box.x0 + (box.width - 1) / 2, box.y0 + (box.height - 1) / 2) for box in boxes]
    rays = camera.rays(np.array(middles_px))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    reach_rad = np.hypot(*_TILE_PX) / 2 * camera.pixel_rad
    return [boxes[i] for i in np.flatnonzero(earth.touches(rays, reach_rad))]


def _smooth(fields: Float32Array) -> BoolArray:
    """(Surface.COUNT, t, m, n) at nodes → (t, m, n): whether what is around a node may be interpolated.

    The error of linear interpolation is at most an eighth of the second difference, for each axis.
    """
    off = np.zeros_like(fields)
    for axis in (2, 3):
        curved = np.abs(np.diff(fields, 2, axis=axis)) / 8
        ends = [(0, 0)] * 4
        ends[axis] = (1, 1)
        off += np.pad(curved, ends, mode="edge")
    surface, error = Surface(fields), Surface(off)
    position = np.maximum(error.normal.max(axis=0), error.drifted.max(axis=0)) * np.float32(RADIUS_M)
    fine = position <= TOLERANCE_PX * surface.footprint_m
    fine &= error.footprint_m <= TOLERANCE_SHARE * surface.footprint_m
    fine &= error.threshold <= TOLERANCE_SHARE
    for light in (error.daylight, error.glitter, error.airlight):
        fine &= light.max(axis=0) <= TOLERANCE
    return np.asarray(fine)


def _cells(nodes: BoolArray) -> BoolArray:
    """(m, n) nodes → (m − 1, n − 1): whether all four nodes around a cell are true."""
    return np.asarray(nodes[1:, 1:] & nodes[1:, :-1] & nodes[:-1, 1:] & nodes[:-1, :-1])
