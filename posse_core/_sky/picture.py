"""The Earth in an image: maps and clouds in every pixel, what varies smoothly only at nodes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray
from posse_core._model.camera import Camera, PixelBox
from posse_core._sky.atmosphere import RADIUS_M, TOP_M
from posse_core._sky.earth import LEAST_VIEW_COSINE, EarthView
from posse_core._sky.surface import Surface

TOLERANCE = 3e-4
"""How far interpolated radiance may be off, per solar irradiance, sr⁻¹: 0.1 % of a white plate's."""
TOLERANCE_PX = 0.2
"""How far an interpolated position on the ground may be off."""
TOLERANCE_SHARE = 0.02
"""How far other interpolated numbers may be off, relative to their size."""
_TILE_PX = (64, 256)
"""Height and width of the parts of an image that are asked whether the Earth is in them."""
_CELL_PX = 8
"""Side of the cells between the nodes."""
_POINTS = 1 << 14
"""How many points are computed at once: few enough for the processor's cache."""


def picture(
    earth: EarthView, camera: Camera, first_row: int, rows: int
) -> Iterator[tuple[PixelBox, Float32Array]]:
    """Boxes of some rows of an image, and the radiance (h, w, 3) of the Earth and its air in each.

    Angles, light and weather are computed at nodes and interpolated linearly in the cells between them.
    Where that would be wrong by more than the tolerances, as near the limb, everything is computed in
    each pixel. If the Earth is only a few pixels wide, each is the mean of several rays.
    """
    boxes = _tiles(camera, earth, first_row, rows)
    samples = earth.samples(camera.pixel_rad)
    if samples > 1:
        yield from ((box, _sampled(earth, camera, box, samples)) for box in boxes)
    elif boxes:
        region = PixelBox.around(boxes)
        yield region, _drawn(earth, camera, region)


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


def _drawn(earth: EarthView, camera: Camera, region: PixelBox) -> Float32Array:
    """(h, w, 3) radiance in a region of the image."""
    height, width = min(region.height, _CELL_PX), min(region.width, _CELL_PX)
    # There are three nodes at least along each side, without which no curvature would be seen.
    down, across = max(2, -(-region.height // height)), max(2, -(-region.width // width))
    image = np.zeros((down * height, across * width, 3), dtype=np.float32)
    canvas = _Canvas(camera, region, image.reshape(down, height, across, width, 3))
    steps = np.stack(np.meshgrid(np.arange(across + 1), np.arange(down + 1)), axis=-1)
    nodes = _Nodes.at(earth, camera, canvas.corner_px + steps * canvas.cell_px, max(height, width))
    inside, empty = _cells(nodes.usable), _cells(nodes.away)
    empty[-(-region.height // height) :] = True
    empty[:, -(-region.width // width) :] = True
    cells = np.argwhere(inside & ~empty)
    first = cells[:, :1] * (across + 1) + cells[:, 1:]
    corners = first + np.array([0, 1, across + 1, across + 2])
    fields = np.take(nodes.fields.reshape(Surface.COUNT, -1), corners, axis=1)
    canvas.draw(earth, cells, Surface(fields, _weights(height, width)))
    canvas.trace(earth, *canvas.pixels(np.argwhere(~(inside | empty))))
    return image[: region.height, : region.width]


@dataclass(frozen=True)
class _Nodes:
    """What is at nodes in rows and columns.

    Attributes:
        fields: (Surface.COUNT, m, n) angles, light and weather.
        usable: (m, n) whether what is around a node may be interpolated.
        away: (m, n) whether nothing of the Earth is within ``apart_px`` of the node.
    """

    fields: Float32Array
    usable: BoolArray
    away: BoolArray

    @classmethod
    def at(cls, earth: EarthView, camera: Camera, nodes_px: FloatArray, apart_px: float) -> _Nodes:
        """Nodes at (m, n, 2) positions in an image, which may be up to a cell outside it."""
        nodes_cam = camera.rays(nodes_px)
        shape, pixel_rad = nodes_cam.shape[:-1], camera.pixel_rad
        # Outside the image a lens may have no directions.
        known = np.isfinite(nodes_cam).all(axis=-1)
        nodes_cam[~known] = [0, 0, 1]
        rays = earth.rays(nodes_cam, pixel_rad)
        fields = earth.surface(rays, np.arange(rays.ahead_m.size))
        fields = fields.reshape(Surface.COUNT, *shape)
        whole = (rays.on_ground == 1).reshape(shape)
        gap_m = 1.5 * apart_px * pixel_rad * np.abs(rays.ahead_m)
        away = ((rays.nearest_m > RADIUS_M + TOP_M + gap_m) | (rays.ahead_m < 0)).reshape(shape)
        cosine = np.sqrt(np.clip(1 - np.square(rays.nearest_m / RADIUS_M), LEAST_VIEW_COSINE**2, 1))
        view_cosine = cosine.reshape(shape).astype(np.float32)
        usable = known & whole & _smooth(fields, view_cosine, earth.sun_rgb_w_m2)
        return cls(fields, usable, known & away)


@dataclass(frozen=True)
class _Canvas:
    """A region of an image in cells, which is drawn cell by cell.

    Attributes:
        camera: the image's.
        region: the region. The cells in the last row and column may go beyond it.
        light: (down, h, across, w, 3) radiance in each pixel of each cell.
    """

    camera: Camera
    region: PixelBox
    light: Float32Array

    @property
    def corner_px(self) -> IntArray:
        """(2,) position of the first pixel."""
        return np.array([self.region.x0, self.region.y0])

    @property
    def cell_px(self) -> IntArray:
        """(2,) width and height of a cell."""
        return np.array([self.light.shape[3], self.light.shape[1]])

    def draw(self, earth: EarthView, cells: IntArray, surface: Surface) -> None:
        """Draw the ground in cells (n, 2) of the canvas, by row and column, of which ``surface`` has the
        nodes and weights."""
        lit = np.flatnonzero(surface.fields[Surface.LIGHT].max(axis=0).max(axis=1) > 0)
        if not len(lit):
            return
        cells, fields = cells[lit], np.take(surface.fields, lit, axis=1)
        longitudes = fields[Surface.LONGITUDES]
        longitudes -= np.rint(longitudes - longitudes[..., :1])
        sea = earth.is_open_sea(Surface(fields))
        # Cells of one kind are drawn together, because that is quick.
        first = Surface(fields[..., 0])
        side = np.abs(first.drifted).argmax(axis=0)
        order = np.lexsort((np.rint(first.log_footprint), 3 * sea + side))
        for part in _parts(order, self.light.shape[1] * self.light.shape[3]):
            chosen = Surface(np.take(fields, part, axis=1), surface.weights)
            light = cv2.merge(list(earth.ground_light(chosen, bool(sea[part].all()))))
            row, column = cells[part].T
            self.light[row, :, column] = light.reshape(len(part), *self.light.shape[1::2], 3)

    def pixels(self, cells: IntArray) -> tuple[IntArray, IntArray]:
        """Rows and columns of all pixels in cells (n, 2): (n, h w) each."""
        width, height = self.cell_px
        v, u = (index.ravel() for index in np.indices((height, width)))
        return cells[:, :1] * height + v, cells[:, 1:] * width + u

    def trace(self, earth: EarthView, v: IntArray, u: IntArray) -> None:
        """Compute everything in each of some pixels, of any shape."""
        seen = (v < self.region.height) & (u < self.region.width)
        v, u = v[seen], u[seen]
        image = self.light.reshape(-1, self.light.shape[2] * self.light.shape[3], 3)
        for part in _parts(np.arange(v.size), 1):
            at_px = self.corner_px + np.stack([u[part], v[part]], axis=-1)
            image[v[part], u[part]] = earth.light(self.camera.rays(at_px), self.camera.pixel_rad)


def _parts(indices: IntArray, points_each: int) -> Iterator[IntArray]:
    """Indices in parts of about _POINTS points."""
    step = max(1, _POINTS // points_each)
    return (indices[start : start + step] for start in range(0, len(indices), step))


def _weights(height: int, width: int) -> Float32Array:
    """(4, height width) shares of a cell's nodes in its pixels, of linear interpolation."""
    along = [np.stack([1 - np.arange(side) / side, np.arange(side) / side]) for side in (height, width)]
    return np.kron(*along).astype(np.float32)


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


def _smooth(fields: Float32Array, view_cosine: Float32Array, sun_w_m2: Float32Array) -> BoolArray:
    """Whether what is around nodes may be interpolated: (m, n).

    The error of linear interpolation is at most an eighth of the second difference, for each axis.

    Args:
        fields: (Surface.COUNT, m, n) at nodes.
        view_cosine: (m, n) cosine of the angle between the ground's normal and the way to the camera.
        sun_w_m2: (3,) sunlight.
    """
    surface, off = Surface(fields), Surface(_off(fields))
    turn = 2 * np.pi * np.sqrt(np.maximum(0, 1 - np.square(surface.normal[2])))
    # What is seen of a sphere is the same at every azimuth about its centre, so that positions are off
    # along the line of sight alone. There a pixel is longer than in the mean, of which the logarithm is.
    ground_radians = np.float32(TOLERANCE_PX / RADIUS_M) * np.exp2(surface.log_footprint)
    ground_radians /= np.sqrt(view_cosine)
    fine = turn * off.fields[Surface.LONGITUDES].max(axis=0) <= ground_radians
    fine &= np.float32(np.pi) * off.latitude <= ground_radians
    fine &= off.fields[Surface.NORMALS].max(axis=0) <= ground_radians
    fine &= off.log_footprint <= np.log2(1 + TOLERANCE_SHARE)
    fine &= off.threshold <= TOLERANCE_SHARE
    fine &= off.relief <= TOLERANCE_SHARE * surface.relief
    light = np.maximum(np.maximum(off.daylight, off.sea), off.airlight)
    for band, sun in zip(light, sun_w_m2, strict=True):
        fine &= band <= TOLERANCE * sun
    # In the dark nobody sees where the ground is.
    fine |= ~(surface.fields[Surface.LIGHT].any(axis=0) | off.fields[Surface.LIGHT].any(axis=0))
    return np.asarray(fine)


def _off(fields: Float32Array) -> Float32Array:
    """(Surface.COUNT, m, n) at nodes → the same shape: how far linear interpolation around each may be
    off, at most."""
    off = np.zeros_like(fields)
    for along, error in ((fields, off), (fields.swapaxes(1, 2), off.swapaxes(1, 2))):
        steps = along[:, 1:] - along[:, :-1]
        turns = steps[Surface.LONGITUDES]
        turns -= np.rint(turns)
        curved = np.abs(steps[:, 1:] - steps[:, :-1])
        error[:, 1:-1] += curved
        error[:, 0] += curved[:, 0]
        error[:, -1] += curved[:, -1]
    off *= np.float32(1 / 8)
    return off


def _cells(nodes: BoolArray) -> BoolArray:
    """(m, n) nodes → (m − 1, n − 1): whether all four nodes around a cell are true."""
    across = nodes[:, 1:] & nodes[:, :-1]
    return np.asarray(across[1:] & across[:-1])
