"""Rays of a camera at one instant: what each pixel shows, and what is in front of a point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._geometry.solids import GRAZING, Placed, shadowed
from posse_core._geometry.triangles import dot, rotated
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import CraftState

SILHOUETTE_RAYS = 1 << 18
"""Maximum number of rays outside the image; a larger silhouette is sampled on a coarser grid."""
_CHUNK = 1 << 13
"""Rays that are cast at once; their arrays fit into the processor's cache."""


@dataclass(frozen=True)
class SolidInView:
    """A solid as the camera sees it at one instant. Vectors are in the solid's axes; positions are
    relative to the centre of its box.

    Attributes:
        placed: the solid and where it is.
        box: the pixels that it may touch.
        camera_m: (3,) position of the camera.
        start_m: planar depth in front of the whole solid.
        normal: (3, T) unit normal of each triangle, on the camera's side.
        normals_cam: (T + 1, 3) float32 the same in camera axes; NaN last, for rays that hit none.
        sunny: (T + 1,) whether the Sun is on the camera's side of the triangle; False last.
    """

    placed: Placed
    box: PixelBox
    camera_m: FloatArray
    start_m: float
    normal: FloatArray
    normals_cam: AnyArray
    sunny: BoolArray

    @classmethod
    def at(cls, placed: Placed, craft: CraftState, box: PixelBox, nearest_m: float) -> SolidInView:
        """The solid for a state; ``nearest_m`` is its least planar depth."""
        triangles = placed.solid.tracer.triangles
        R, t_m = placed.R_cam_from_link, placed.t_link_cam_m[:, 0]
        camera_m = -dot(R, t_m) - triangles.centre_body_m
        behind = dot(triangles.normal, camera_m) < triangles.plane_m
        normal = np.where(behind, -triangles.normal, triangles.normal)
        sun_direction = R.T @ craft.sun_direction_cam
        normals_cam = rotated(R, normal).astype(np.float32).T
        return cls(
            placed=placed,
            box=box,
            camera_m=camera_m,
            start_m=max(0.0, nearest_m - 0.01 * triangles.size_m),
            normal=normal,
            normals_cam=np.append(normals_cam, np.full((1, 3), np.nan, dtype=np.float32), axis=0),
            sunny=np.append(dot(normal, sun_direction) > GRAZING, False),
        )

    def first(self, directions: FloatArray) -> tuple[IntArray, FloatArray]:
        """(3, N) ray directions → index of the first triangle (N,), −1 for none, and the planar depth
        (N,) of the hit, infinite for none."""
        return self.placed.solid.tracer.first(self.camera_m[:, None], directions, self.start_m)


@dataclass(frozen=True)
class Pixels:
    """What the pixels of a box show; the arrays are as in :class:`posse_core.View`.

    Attributes:
        covered_px: (B,) number of pixels that each body would cover without the others.
    """

    part_id: AnyArray
    triangle: AnyArray
    depth_m: AnyArray
    normal_cam: AnyArray
    lit: BoolArray
    covered_px: IntArray

    @classmethod
    def empty(cls, shape: tuple[int, int], bodies: int) -> Pixels:
        """Pixels that show nothing."""
        return cls(
            part_id=np.full(shape, -1, dtype=np.int16),
            triangle=np.full(shape, -1, dtype=np.int32),
            depth_m=np.full(shape, np.nan, dtype=np.float32),
            normal_cam=np.full((*shape, 3), np.nan, dtype=np.float32),
            lit=np.zeros(shape, dtype=np.bool_),
            covered_px=np.zeros(bodies, dtype=np.int64),
        )


@dataclass(frozen=True)
class _Hits:
    """N rays that hit a solid.

    Attributes:
        number: of the solid.
        pixel: (N,) index of each ray's pixel in the box, row by row.
        triangle: (N,) index of the triangle.
        z_m: (N,) planar depth.
        directions: (3, N) of the rays, axes of the solid.
    """

    number: int
    pixel: IntArray
    triangle: IntArray
    z_m: FloatArray
    directions: FloatArray

    def chosen(self, rays: IntArray) -> _Hits:
        """Some of them, by their indices."""
        return _Hits(
            self.number,
            self.pixel[rays],
            self.triangle[rays],
            self.z_m[rays],
            np.take(self.directions, rays, axis=1),
        )


@dataclass(frozen=True)
class InstantCaster:
    """Casts rays from the camera at one instant.

    Attributes:
        camera: whose rays they are.
        craft: the bodies and the Sun.
        solids: all solids of the scene.
    """

    camera: Camera
    craft: CraftState
    solids: Sequence[SolidInView]

    def pixels(self, box: PixelBox, bodies: int) -> Pixels:
        """What the pixels of a box show, of a scene with a number of bodies."""
        pixels = Pixels.empty((box.height, box.width), bodies)
        if len(self.solids) == 1:
            for hits in self._hits(0, box):
                pixels.covered_px[self.solids[0].placed.solid.body] += len(hits.pixel)
                self._shade(pixels, hits)
            return pixels
        every = [hits for number in range(len(self.solids)) for hits in self._hits(number, box)]
        size = box.height * box.width
        nearest_m, owner = np.full(size, np.inf), np.full(size, -1)
        covered = np.zeros((bodies, size), dtype=np.bool_)
        for hits in every:
            covered[self.solids[hits.number].placed.solid.body, hits.pixel] = True
            nearer = hits.z_m < nearest_m[hits.pixel]
            pixel = hits.pixel[nearer]
            nearest_m[pixel], owner[pixel] = hits.z_m[nearer], hits.number
        pixels.covered_px[:] = covered.sum(axis=1)
        for hits in every:
            self._shade(pixels, hits.chosen(np.flatnonzero(owner[hits.pixel] == hits.number)))
        return pixels

    def _hits(self, number: int, box: PixelBox) -> Iterator[_Hits]:
        """Where the rays of a box hit a solid, whatever is in front of it, some rows at a time."""
        solid = self.solids[number]
        own = _common(solid.box, box)
        u_px = np.arange(own.x0, own.x0 + own.width, dtype=np.float64)
        for rows in _row_blocks(own.height, own.width):
            v_px = own.y0 + np.arange(rows.start, rows.stop, dtype=np.float64)
            directions = self.directions(solid.placed, u_px, v_px).reshape(3, -1)
            triangle, z_m = solid.first(directions)
            hit = np.flatnonzero(triangle >= 0)
            row, column = np.divmod(hit, own.width)
            pixel = (row + rows.start + own.y0 - box.y0) * box.width + column + own.x0 - box.x0
            yield _Hits(number, pixel, triangle[hit], z_m[hit], np.take(directions, hit, axis=1))

    def _shade(self, pixels: Pixels, hits: _Hits) -> None:
        """Enter what pixels show where the rays hit a solid, and whether it is lit."""
        solid, triangle = self.solids[hits.number], hits.triangle
        pixels.part_id.reshape(-1)[hits.pixel] = np.take(solid.placed.solid.part_id, triangle)
        pixels.triangle.reshape(-1)[hits.pixel] = np.take(solid.placed.solid.face, triangle)
        pixels.depth_m.reshape(-1)[hits.pixel] = hits.z_m
        pixels.normal_cam.reshape(-1, 3)[hits.pixel] = np.take(solid.normals_cam, triangle, axis=0)
        bright = hits.chosen(np.flatnonzero(np.take(solid.sunny, triangle)))
        point_m = solid.camera_m[:, None] + bright.z_m * bright.directions
        normal = np.take(solid.normal, bright.triangle, axis=1)
        placed = [each.placed for each in self.solids]
        sun = self.craft.sun_direction_cam[:, None]
        dark = shadowed(placed, hits.number, point_m, normal, sun)
        pixels.lit.reshape(-1)[bright.pixel] = ~dark

    def directions(self, placed: Placed, u_px: FloatArray, v_px: FloatArray) -> FloatArray:
        """Ray directions through a grid of pixels: columns (w,) and rows (h,) → (3, h, w) in the axes of
        a solid."""
        R = placed.R_cam_from_link
        x = (u_px - self.camera.cx_px) / self.camera.fx_px
        y = (v_px[:, None] - self.camera.cy_px) / self.camera.fy_px
        if self.camera.distortion is not None:
            x, y = self.camera.distortion.undistort(x, y)
        return np.stack([x * R[0, k] + (y * R[1, k] + R[2, k]) for k in range(3)])

    def behind_m(self, body: int, link: int, x_link_m: FloatArray) -> FloatArray:
        """How far points are behind the first surface on the ray to each, m; 0 or less if nothing is in
        front of them.

        Args:
            body, link: number of the points' body, and of their link within it.
            x_link_m: (3, N) in the link's axes; all must be in front of the camera.
        """
        none_s = np.zeros(x_link_m.shape[1])
        x_cam_m = self.craft.bodies[body].in_camera(x_link_m.T, none_s, link).T
        depth_m = x_cam_m[2]
        nearest_m = np.full(len(depth_m), np.inf)
        for solid in self.solids:
            placed = solid.placed
            centre_m = placed.solid.tracer.triangles.centre_body_m[:, None]
            here_m = (
                x_link_m - centre_m
                if (placed.solid.body, placed.solid.link) == (body, link)
                else placed.point_here(x_cam_m)
            )
            nearest_m = np.minimum(
                nearest_m, solid.first((here_m - solid.camera_m[:, None]) / depth_m)[1]
            )
        lengths = np.sqrt(dot(x_cam_m, x_cam_m)) / depth_m
        return np.asarray((depth_m - nearest_m) * lengths)

    def count_beyond(self, body: int, box: PixelBox, field: PixelBox) -> int:
        """Number of pixels of ``field`` outside ``box`` that a body covers."""
        count = field.width * field.height - box.width * box.height
        stride = 1
        while count > SILHOUETTE_RAYS * stride**2:
            stride += 1
        u_px = np.arange(field.x0, field.x0 + field.width, stride, dtype=np.float64)
        v_px = np.arange(field.y0, field.y0 + field.height, stride, dtype=np.float64)
        column_in = (u_px >= box.x0) & (u_px < box.x0 + box.width)
        row_in = (v_px >= box.y0) & (v_px < box.y0 + box.height)
        own = [solid for solid in self.solids if solid.placed.solid.body == body]
        hits = 0
        for rows in _row_blocks(len(v_px), len(u_px)) if count else ():
            beyond = ~(row_in[rows, None] & column_in)
            covered = np.zeros(int(beyond.sum()), dtype=np.bool_)
            for solid in own:
                rays = self.directions(solid.placed, u_px, v_px[rows])[:, beyond]
                known = np.flatnonzero(np.isfinite(rays[0]))  # the lens does not map the others
                covered[known] |= solid.first(np.take(rays, known, axis=1))[0] >= 0
            hits += int(covered.sum())
        return hits * stride**2


def _common(a: PixelBox, b: PixelBox) -> PixelBox:
    """The pixels that two boxes have in common."""
    x0, y0 = max(a.x0, b.x0), max(a.y0, b.y0)
    width = min(a.x0 + a.width, b.x0 + b.width) - x0
    height = min(a.y0 + a.height, b.y0 + b.height) - y0
    return PixelBox(x0, y0, max(0, width), max(0, height))


def _row_blocks(height: int, width: int) -> Iterator[slice]:
    step = max(1, _CHUNK // max(1, width))
    for start in range(0, height, step):
        yield slice(start, min(start + step, height))
