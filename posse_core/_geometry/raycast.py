"""The spacecraft as the camera sees it, by one ray through each pixel's centre and one to each keypoint.

A ray is x = camera + z d, where d has length 1 along the optical axis, so that z is the planar depth.
Rays are traced in body axes with the origin at the centre of the spacecraft's bounding box, so that
single precision suffices at ranges of 100 km.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._geometry.outline import edges_of, extent_px
from posse_core._geometry.rays import cast_rays
from posse_core._geometry.rows import seen_by_rows
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles, dot, rotated
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE, View
from posse_core._model.ray_hits import RayHits
from posse_core._model.scene import CraftState, Scene
from posse_core._model.shutter import LABEL_STEP_PX, Moment, fastest_px_s, moments

KEYPOINT_DEPTH_SHARE = 0.055 / 16.7
"""How far behind the surface a keypoint still counts as visible, as a share of the spacecraft's longest
side: the thesis' 0.055 m (Section 3.4.3) on Aqua's 16.7 m."""
SILHOUETTE_FIELD = 10.0
"""Extent of the unbounded image for ``silhouette_px``: focal lengths from the principal point (84°).
With a distorting lens it may end earlier, at the lens's reach."""
SILHOUETTE_RAYS = 1 << 18
"""Maximum number of rays outside the image; a larger silhouette is sampled on a coarser grid."""
_CHUNK = 1 << 13
"""Rays that are cast at once; their arrays fit into the processor's cache."""
_NO_BOX = PixelBox(0, 0, 0, 0)
_LEAST_DEPTH_SHARE = 0.01
"""Least depth at which image motion is computed, as a share of the spacecraft's size; it applies where a
part reaches behind the camera."""


class RayCaster:
    """Casts rays onto the spacecraft of one scene. The view of a frame depends on no other frame."""

    def __init__(self, scene: Scene) -> None:
        spacecraft = scene.spacecraft
        self._camera = scene.camera
        self._tracer = Tracer(Triangles.of(spacecraft))
        vertices_body_m = np.concatenate([part.vertices_body_m for part in spacecraft.parts])
        self._vertices_body_m = np.ascontiguousarray(vertices_body_m.T)
        counts = np.cumsum([0] + [len(part.vertices_body_m) for part in spacecraft.parts])
        self._edges = edges_of(
            np.concatenate([n + part.faces for n, part in zip(counts, spacecraft.parts, strict=False)])
        )
        self._keypoints_body_m = (
            np.array([*spacecraft.keypoints_body_m.values()], float).reshape(-1, 3).T
        )

    def through(self, camera: Camera) -> RayCaster:
        """The ray caster of another camera on the same spacecraft."""
        other = copy(self)
        other._camera = camera
        return other

    def view(self, craft: CraftState) -> View:
        """The spacecraft as the camera's rays hit it in one frame, each row at its own time."""
        camera = self._camera
        low_px, high_px = self._bounds(self._seen(craft, self._vertices_body_m))
        bands = [self._band(craft, moment) for moment in self.moments(craft, LABEL_STEP_PX)]
        box = PixelBox.around(band.box for band in bands)
        keypoints_px = camera.project(self._seen(craft, self._keypoints_body_m).T)
        visibility = np.full(len(keypoints_px), NOT_IN_FRAME, dtype=np.int8)
        size_px = np.array([camera.width_px, camera.height_px])
        inside = ((keypoints_px >= -0.5) & (keypoints_px < size_px - 0.5)).all(axis=1)
        pixels = []
        beyond_px = 0
        for band in bands:
            first, rows = band.moment.first_row, band.moment.rows
            caster = _InstantCaster.at(self._tracer, camera, band.craft, band.nearest_m)
            pixels.append(caster.pixels(box.within_rows(first, rows)))
            beyond_px += caster.count_beyond(band.box, band.field)
            row = np.floor(keypoints_px[:, 1] + 0.5)
            in_band = np.flatnonzero(inside & (row >= first) & (row < first + rows))
            visibility[in_band] = self._visibility(caster, band.craft, in_band)
        part_id, triangle, depth_m, normal_cam, lit = (
            np.concatenate(parts) for parts in zip(*pixels, strict=True)
        )
        return View(
            box=box,
            part_id=part_id,
            triangle=triangle,
            depth_m=depth_m,
            normal_cam=normal_cam,
            lit=lit,
            silhouette_px=int((part_id >= 0).sum()) + beyond_px,
            keypoints_px=keypoints_px,
            keypoints_visibility=visibility,
            whole_box_px=np.concatenate([low_px, high_px - low_px]),
        )

    def rays(
        self,
        craft: CraftState,
        directions: FloatArray,
        origin_m: ArrayLike = (0.0, 0.0, 0.0),
        after_s: ArrayLike = 0.0,
    ) -> RayHits:
        """What single rays hit, each at its own instant, while the spacecraft and the camera move by
        their rates.

        The distances are exact in double precision, like those of :meth:`view`; the scene's image plays
        no part.

        Args:
            craft: the state at the instant from which ``after_s`` counts. Its axes are those of the
                rays: the camera's, or those of a sensor elsewhere.
            directions: (N, 3) of any length but zero, in the state's axes at the ray's own instant.
            origin_m: (3,) origin of all rays, or (N, 3), in the same axes.
            after_s: seconds after the instant, of all rays or (N,).

        Raises:
            ValueError: A direction is zero or not finite.
        """
        return cast_rays(self._tracer, craft, directions, origin_m, after_s)

    def moments(
        self, craft: CraftState, step_px: float, exposure_s: float = 0.0, instants: int = 1
    ) -> list[Moment]:
        """Divide a frame into moments in which the spacecraft moves by at most ``step_px`` in the image;
        see :func:`posse_core._model.shutter.moments`."""
        moves = self._camera.line_time_s > 0 or (exposure_s > 0 and instants > 1)
        speed_px_s = self.speed_px_s(craft) if moves else 0.0
        return moments(self._camera, speed_px_s, step_px, exposure_s, instants)

    def speed_px_s(self, craft: CraftState) -> float:
        """Largest speed in the image that a point of the spacecraft may have; of the whole image, if the
        spacecraft is out of view."""
        box = self.box(craft)
        if box.is_empty:
            box = PixelBox(0, 0, self._camera.width_px, self._camera.height_px)
        vertices_z_m = _in_camera(craft, self._vertices_body_m)[2]
        far_m = max(float(vertices_z_m.max()), _LEAST_DEPTH_SHARE * self._tracer.triangles.size_m)
        near_m = max(float(vertices_z_m.min()), _LEAST_DEPTH_SHARE * self._tracer.triangles.size_m)
        omega, v = craft.rates.relative(craft.R_cam_from_body, craft.t_body_cam_m)
        return fastest_px_s(self._camera, box, v, omega, near_m, far_m)

    def box(self, craft: CraftState) -> PixelBox:
        """Pixels of the image that the spacecraft may touch if all rows are exposed at the same time."""
        return self._boxes(_in_camera(craft, self._vertices_body_m))[0]

    def _seen(self, craft: CraftState, points_body_m: FloatArray) -> FloatArray:
        """(3, N) body axes → (3, N) camera axes, each at the time of the row that sees it."""
        if self._camera.line_time_s == 0:
            return _in_camera(craft, points_body_m)
        return seen_by_rows(craft, self._camera, points_body_m.T)[0].T

    def _bounds(self, points_cam_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(3, V) vertices in camera axes → lowest and highest image position of the spacecraft, (2,)
        each; NaN if a vertex is behind the camera or beyond the reach of its lens."""
        return extent_px(self._camera, points_cam_m.T, self._edges)

    def _boxes(self, vertices_cam_m: FloatArray) -> tuple[PixelBox, PixelBox]:
        """Boxes in the image and in the silhouette's field if all rows are exposed at the same time."""
        if not (vertices_cam_m[2] > 0).any():
            return _NO_BOX, _NO_BOX
        return _boxes(self._camera, *self._bounds(vertices_cam_m))

    def _band(self, craft: CraftState, moment: Moment) -> _Band:
        then = craft.after(moment.after_s)
        vertices_cam_m = _in_camera(then, self._vertices_body_m)
        box, field = self._boxes(vertices_cam_m)
        # Rows outside the image have the time of its first or last row.
        last_row = moment.first_row + moment.rows
        top = moment.first_row if moment.first_row > 0 else field.y0
        bottom = last_row if last_row < self._camera.height_px else field.y0 + field.height
        return _Band(
            moment=moment,
            box=box.within_rows(moment.first_row, moment.rows),
            field=field.within_rows(top, max(0, bottom - top)),
            craft=then,
            nearest_m=float(vertices_cam_m[2].min()),
        )

    def _visibility(self, caster: _InstantCaster, craft: CraftState, keypoints: IntArray) -> IntArray:
        """(k,) int8 visibility, as in :class:`View`, of the keypoints with the indices ``keypoints``,
        all of which are in the image."""
        body_m = self._keypoints_body_m[:, keypoints]
        depth_m = _in_camera(craft, body_m)[2]
        centre_body_m = self._tracer.triangles.centre_body_m
        directions = (body_m - (centre_body_m + caster.camera_m)[:, None]) / depth_m
        _, z_m = caster.first(directions)
        behind_m = (depth_m - z_m) * np.sqrt(dot(directions, directions))
        hidden = behind_m > KEYPOINT_DEPTH_SHARE * self._tracer.triangles.size_m
        return np.where(hidden, OCCLUDED, VISIBLE)


@dataclass(frozen=True)
class _Band:
    """Rows that are treated as exposed at the same time.

    Attributes:
        moment: the rows and their time.
        box, field: the pixels that the spacecraft may touch in these rows: in the image, and in the
            field of the silhouette.
        craft: the spacecraft and its sunlight at that time.
        nearest_m: least planar depth of the spacecraft at that time.
    """

    moment: Moment
    box: PixelBox
    field: PixelBox
    craft: CraftState
    nearest_m: float


@dataclass(frozen=True)
class _InstantCaster:
    """Casts rays from the camera at one instant. Vectors are in body axes; positions are relative to the
    centre of the spacecraft's bounding box.

    Attributes:
        camera_m: (3,) position of the camera.
        R_cam_from_body: (3, 3).
        start_m: planar depth in front of the whole spacecraft.
        normal: (3, T) unit normal of each triangle, on the camera's side.
        sunny: (T,) whether the Sun is on the camera's side of the triangle.
        sun_direction: (3,) unit vector to the Sun.
    """

    tracer: Tracer
    camera: Camera
    camera_m: FloatArray
    R_cam_from_body: FloatArray
    start_m: float
    normal: FloatArray
    sunny: BoolArray
    sun_direction: FloatArray

    @classmethod
    def at(cls, tracer: Tracer, camera: Camera, craft: CraftState, nearest_m: float) -> _InstantCaster:
        """The caster for a state; ``nearest_m`` is the least planar depth of the spacecraft."""
        triangles = tracer.triangles
        R = craft.R_cam_from_body
        camera_m = -dot(R, craft.t_body_cam_m) - triangles.centre_body_m
        behind = dot(triangles.normal, camera_m) < triangles.plane_m
        normal = np.where(behind, -triangles.normal, triangles.normal)
        sun_direction = craft.sun_direction_body
        return cls(
            tracer=tracer,
            camera=camera,
            camera_m=camera_m,
            R_cam_from_body=R,
            start_m=max(0.0, nearest_m - 0.01 * triangles.size_m),
            normal=normal,
            sunny=dot(normal, sun_direction) > 0,
            sun_direction=sun_direction,
        )

    def directions(self, u_px: FloatArray, v_px: FloatArray) -> FloatArray:
        """Ray directions through a grid of pixels: columns (w,) and rows (h,) → (3, h, w) body axes."""
        R = self.R_cam_from_body
        x = (u_px - self.camera.cx_px) / self.camera.fx_px
        y = (v_px[:, None] - self.camera.cy_px) / self.camera.fy_px
        if self.camera.distortion is not None:
            x, y = self.camera.distortion.undistort(x, y)
        return np.stack([x * R[0, k] + (y * R[1, k] + R[2, k]) for k in range(3)])

    def first(self, directions: FloatArray) -> tuple[IntArray, FloatArray]:
        """(3, N) ray directions → index of the first triangle (N,), −1 for none, and the planar depth
        (N,) of the hit, infinite for none."""
        return self.tracer.first(self.camera_m[:, None], directions, self.start_m)

    def pixels(self, box: PixelBox) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray, BoolArray]:
        """``part_id``, ``triangle``, ``depth_m``, ``normal_cam`` and ``lit`` of :class:`View` for a
        box."""
        shape = (box.height, box.width)
        part_id = np.empty(shape, dtype=np.int16)
        face = np.empty(shape, dtype=np.int32)
        depth_m = np.empty(shape, dtype=np.float32)
        normal_cam = np.empty((*shape, 3), dtype=np.float32)
        lit = np.zeros(shape, dtype=np.bool_)
        # These tables have one row per triangle, and a last one (index −1) for rays that hit none.
        parts = np.append(self.tracer.triangles.part_id, np.int16(-1))
        faces = np.append(self.tracer.triangles.face, -1).astype(np.int32)
        turned = rotated(self.R_cam_from_body, self.normal).astype(np.float32)
        normals_cam = np.append(turned.T, np.full((1, 3), np.nan, dtype=np.float32), axis=0)
        sunny = np.append(self.sunny, False)
        u_px = np.arange(box.x0, box.x0 + box.width, dtype=np.float64)
        for rows in _row_blocks(box.height, box.width):
            v_px = box.y0 + np.arange(rows.start, rows.stop, dtype=np.float64)
            directions = self.directions(u_px, v_px).reshape(3, -1)
            triangle, z_m = self.first(directions)
            block = (rows.stop - rows.start, box.width)
            part_id[rows] = np.take(parts, triangle).reshape(block)
            face[rows] = np.take(faces, triangle).reshape(block)
            depth_m[rows] = np.where(triangle >= 0, z_m, np.nan).reshape(block)
            normal_cam[rows] = np.take(normals_cam, triangle, axis=0).reshape(*block, 3)
            rays = np.flatnonzero(np.take(sunny, triangle))
            point_m = self.camera_m[:, None] + z_m[rays] * np.take(directions, rays, axis=1)
            normal = np.take(self.normal, triangle[rays], axis=1)
            shadowed = self.tracer.shadowed(point_m, normal, self.sun_direction[:, None])
            lit[rows].reshape(-1)[rays] = ~shadowed
        return part_id, face, depth_m, normal_cam, lit

    def count_beyond(self, box: PixelBox, field: PixelBox) -> int:
        """Number of pixels of ``field`` outside ``box`` that the spacecraft covers."""
        count = field.width * field.height - box.width * box.height
        stride = 1
        while count > SILHOUETTE_RAYS * stride**2:
            stride += 1
        u_px = np.arange(field.x0, field.x0 + field.width, stride, dtype=np.float64)
        v_px = np.arange(field.y0, field.y0 + field.height, stride, dtype=np.float64)
        column_in = (u_px >= box.x0) & (u_px < box.x0 + box.width)
        row_in = (v_px >= box.y0) & (v_px < box.y0 + box.height)
        hits = 0
        for rows in _row_blocks(len(v_px), len(u_px)) if count else ():
            beyond = ~(row_in[rows, None] & column_in)
            rays = self.directions(u_px, v_px[rows])[:, beyond]
            rays = rays[:, np.isfinite(rays[0])]  # pixels that the lens does not map are not counted
            hits += int((self.first(rays)[0] >= 0).sum())
        return hits * stride**2


def _in_camera(craft: CraftState, body_m: FloatArray) -> FloatArray:
    """(3, N) body axes → (3, N) camera axes."""
    return rotated(craft.R_cam_from_body, body_m) + craft.t_body_cam_m[:, None]


def _row_blocks(height: int, width: int) -> Iterator[slice]:
    step = max(1, _CHUNK // max(1, width))
    for start in range(0, height, step):
        yield slice(start, min(start + step, height))


def _boxes(camera: Camera, low_px: FloatArray, high_px: FloatArray) -> tuple[PixelBox, PixelBox]:
    """The pixels that the spacecraft may touch: in the image, and in the field of the silhouette.

    If a bound is NaN, because the spacecraft reaches behind the camera or beyond the reach of its lens,
    it may touch any pixel on that side.
    """
    low = np.where(np.isnan(low_px), -np.inf, low_px)
    high = np.where(np.isnan(high_px), np.inf, high_px)
    principal = np.array([camera.cx_px, camera.cy_px])
    field = SILHOUETTE_FIELD
    if camera.distortion is not None:
        field = min(field, camera.distortion.image_radius)
    reach = field * np.array([camera.fx_px, camera.fy_px])
    image = np.array([camera.width_px - 1, camera.height_px - 1])
    return (
        _touched(low, high, np.zeros(2), image),
        _touched(low, high, np.ceil(principal - reach), np.floor(principal + reach)),
    )


def _touched(low: FloatArray, high: FloatArray, first: FloatArray, last: FloatArray) -> PixelBox:
    """The pixels from position ``low`` to ``high``, limited to those from ``first`` to ``last``; each
    (2,)."""
    x0, y0 = np.floor(np.clip(low + 0.5, first, last + 1)).astype(int).tolist()
    x1, y1 = np.floor(np.clip(high + 0.5, first - 1, last)).astype(int).tolist()
    box = PixelBox(x0, y0, x1 - x0 + 1, y1 - y0 + 1)
    return _NO_BOX if box.is_empty else box
