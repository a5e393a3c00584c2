"""The bodies of a scene as the camera sees them, by one ray through each pixel's centre and one to each
keypoint.

A ray is x = camera + z d, where d has length 1 along the optical axis, so that z is the planar depth.
Rays are traced in the axes of each link with the origin at the centre of its bounding box, so that
single precision suffices at ranges of 100 km.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray, IntArray
from posse_core._geometry.instant import InstantCaster, SolidInView
from posse_core._geometry.rays import cast_rays
from posse_core._geometry.rows import seen_by_rows
from posse_core._geometry.solids import Solid, placed_at, solids_of
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import BodyState, CraftState
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE, View
from posse_core._model.ray_hits import RayHits
from posse_core._model.scene import Scene
from posse_core._model.shutter import LABEL_STEP_PX, Moment, fastest_px_s, moments
from posse_core._model.spacecraft import Spacecraft

KEYPOINT_DEPTH_SHARE = 0.055 / 16.7
"""How far behind the surface a keypoint still counts as visible, as a share of the spacecraft's longest
side: the thesis' 0.055 m (Section 3.4.3) on Aqua's 16.7 m."""
SILHOUETTE_FIELD = 10.0
"""Extent of the unbounded image for ``silhouette_px``: focal lengths from the principal point (84°).
With a distorting lens it may end earlier, at the lens's reach."""
_NO_BOX = PixelBox(0, 0, 0, 0)
_LEAST_DEPTH_SHARE = 0.01
"""Least depth at which image motion is computed, as a share of the spacecraft's size; it applies where a
part reaches behind the camera."""


class RayCaster:
    """Casts rays onto the bodies of one scene. The view of a frame depends on no other frame."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._camera = scene.camera
        self._solids = solids_of(scene)
        self._keypoints = tuple(Keypoints.of(spacecraft) for spacecraft in scene.bodies)
        self._numbers = [_numbers_about(scene, number) for number in range(len(scene.bodies))]

    def through(self, camera: Camera) -> RayCaster:
        """The ray caster of another camera on the same bodies."""
        other = copy(self)
        other._camera = camera
        return other

    def view(self, craft: CraftState) -> View:
        """The scene as the camera's rays hit it in one frame, each row at its own time."""
        return self.views(craft)[0]

    def views(self, craft: CraftState) -> tuple[View, ...]:
        """The same for each body in the target's place, as :meth:`posse_core.Scene.about` numbers
        parts. The box of the first holds all bodies, that of another the body itself."""
        camera, bodies = self._camera, self._scene.bodies
        _check_links(self._scene, craft)
        poses = craft.link_poses()
        whole = self._extents(
            {solid: solid.seen(craft, camera, poses) for solid in self._solids}, len(bodies)
        )
        bands = [self._band(craft, moment) for moment in self.moments(craft, LABEL_STEP_PX)]
        box = PixelBox.around(band.box for band in bands)
        keypoints_px = [
            camera.project(keypoints.seen(body, camera))
            for keypoints, body in zip(self._keypoints, craft.bodies, strict=True)
        ]
        visibility = [np.full(len(px), NOT_IN_FRAME, dtype=np.int8) for px in keypoints_px]
        size_px = np.array([camera.width_px, camera.height_px])
        pixels = []
        covered_px = np.zeros(len(bodies), dtype=np.int64)
        for band in bands:
            first, rows = band.moment.first_row, band.moment.rows
            caster = InstantCaster(camera, band.craft, band.solids)
            found = caster.pixels(box.within_rows(first, rows), len(bodies))
            pixels.append(found)
            covered_px += found.covered_px
            for number, (own_box, own_field) in enumerate(band.of_bodies):
                covered_px[number] += caster.count_beyond(number, own_box, own_field)
            for number, px in enumerate(keypoints_px):
                inside = ((px >= -0.5) & (px < size_px - 0.5)).all(axis=1)
                row = np.floor(px[:, 1] + 0.5)
                in_band = np.flatnonzero(inside & (row >= first) & (row < first + rows))
                visibility[number][in_band] = self._visibility(caster, number, in_band)
        part_id, triangle, depth_m, normal_cam, lit = (
            np.concatenate([getattr(each, name) for each in pixels])
            for name in ("part_id", "triangle", "depth_m", "normal_cam", "lit")
        )
        views = []
        for number, (low_px, high_px) in enumerate(whole):
            parts, faces = self._numbers[number]
            own = box if number == 0 else PixelBox.around(band.of_bodies[number][0] for band in bands)
            within = own.within(box)
            views.append(
                View(
                    box=own,
                    part_id=parts[part_id[within]] if number else part_id,
                    triangle=faces[triangle[within]] if number else triangle,
                    depth_m=depth_m[within],
                    normal_cam=normal_cam[within],
                    lit=lit[within],
                    silhouette_px=int(covered_px[number]),
                    keypoints_px=keypoints_px[number],
                    keypoints_visibility=visibility[number],
                    whole_box_px=np.concatenate([low_px, high_px - low_px]),
                    target_parts=len(bodies[number].parts),
                )
            )
        return tuple(views)

    def rays(
        self,
        craft: CraftState,
        directions: FloatArray,
        origin_m: ArrayLike = (0.0, 0.0, 0.0),
        after_s: ArrayLike = 0.0,
    ) -> RayHits:
        """What single rays hit, each at its own instant, while the bodies and the camera move by
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
        return cast_rays(self._solids, craft, directions, origin_m, after_s)

    def renumbered(self, hits: RayHits, number: int) -> RayHits:
        """The hits with parts and triangles as :meth:`posse_core.Scene.about` numbers them."""
        if number == 0:
            return hits
        parts, faces = self._numbers[number]
        return replace(hits, part_id=parts[hits.part_id], triangle=faces[hits.triangle])

    def moments(
        self, craft: CraftState, step_px: float, exposure_s: float = 0.0, instants: int = 1
    ) -> list[Moment]:
        """Divide a frame into moments in which no body moves by more than ``step_px`` in the image;
        see :func:`posse_core._model.shutter.moments`."""
        moves = self._camera.line_time_s > 0 or (exposure_s > 0 and instants > 1)
        speed_px_s = self.speed_px_s(craft) if moves else 0.0
        return moments(self._camera, speed_px_s, step_px, exposure_s, instants)

    def speed_px_s(self, craft: CraftState) -> float:
        """Largest speed in the image that a point of a body may have; of the whole image, if the
        bodies are out of view."""
        camera, poses = self._camera, craft.link_poses()
        in_camera = {solid: solid.in_camera(camera, poses) for solid in self._solids}
        boxes = {solid: self._boxes_of(solid, x_m)[0] for solid, x_m in in_camera.items()}
        in_view = [solid for solid in self._solids if not boxes[solid].is_empty]
        speeds = []
        for solid in in_view or self._solids:
            box = boxes[solid]
            if box.is_empty:
                box = PixelBox(0, 0, camera.width_px, camera.height_px)
            z_m, size_m = in_camera[solid][2], solid.tracer.triangles.size_m
            far_m = max(float(z_m.max()), _LEAST_DEPTH_SHARE * size_m)
            near_m = max(float(z_m.min()), _LEAST_DEPTH_SHARE * size_m)
            omega, v = craft.bodies[solid.body].motion(solid.link)
            speeds.append(fastest_px_s(camera, box, v, omega, near_m, far_m))
        return max(speeds)

    def box(self, craft: CraftState) -> PixelBox:
        """Pixels of the image that a body may touch if all rows are exposed at the same time."""
        poses = craft.link_poses()
        return PixelBox.around(
            self._boxes_of(solid, solid.in_camera(self._camera, poses))[0] for solid in self._solids
        )

    def _extents(
        self, vertices_cam_m: Mapping[Solid, FloatArray], bodies: int
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Lowest and highest image position of each body, (2,) each; NaN if a vertex is behind the
        camera or beyond the reach of its lens."""
        extents: list[list[tuple[FloatArray, FloatArray]]] = [[] for _ in range(bodies)]
        for solid, x_m in vertices_cam_m.items():
            extents[solid.body].append(solid.extent_px(self._camera, x_m))
        return [
            (np.minimum.reduce([low for low, _ in own]), np.maximum.reduce([high for _, high in own]))
            for own in extents
        ]

    def _boxes_of(self, solid: Solid, vertices_cam_m: FloatArray) -> tuple[PixelBox, PixelBox]:
        """Boxes in the image and in the silhouette's field if all rows are exposed at the same time."""
        if not (vertices_cam_m[2] > 0).any():
            return _NO_BOX, _NO_BOX
        return _boxes(self._camera, *solid.extent_px(self._camera, vertices_cam_m))

    def _band(self, craft: CraftState, moment: Moment) -> _Band:
        then = craft.after(moment.after_s)
        poses = then.link_poses()
        # Rows outside the image have the time of its first or last row.
        last_row = moment.first_row + moment.rows
        is_last = last_row >= self._camera.height_px
        solids, boxes = [], [([_NO_BOX], [_NO_BOX]) for _ in self._scene.bodies]
        for placed in placed_at(self._solids, poses):
            vertices_cam_m = placed.solid.in_camera(self._camera, poses)
            box, field = self._boxes_of(placed.solid, vertices_cam_m)
            top = moment.first_row if moment.first_row > 0 else field.y0
            bottom = field.y0 + field.height if is_last else last_row
            box = box.within_rows(moment.first_row, moment.rows)
            solids.append(SolidInView.at(placed, then, box, float(vertices_cam_m[2].min())))
            boxes[placed.solid.body][0].append(box)
            boxes[placed.solid.body][1].append(field.within_rows(top, max(0, bottom - top)))
        of_bodies = [(PixelBox.around(own), PixelBox.around(fields)) for own, fields in boxes]
        return _Band(moment, PixelBox.around(box for box, _ in of_bodies), of_bodies, then, solids)

    def _visibility(self, caster: InstantCaster, body: int, keypoints: IntArray) -> IntArray:
        """(k,) int8 visibility, as in :class:`View`, of a body's keypoints with the indices
        ``keypoints``, all of which are in the image."""
        known = self._keypoints[body]
        links = known.link[keypoints]
        visibility = np.full(len(keypoints), VISIBLE, dtype=np.int8)
        for link in np.unique(links):
            of_link = np.flatnonzero(links == link)
            behind_m = caster.behind_m(body, int(link), known.x_link_m[keypoints[of_link]].T)
            visibility[of_link[behind_m > KEYPOINT_DEPTH_SHARE * known.size_m]] = OCCLUDED
        return visibility


@dataclass(frozen=True)
class Keypoints:
    """The keypoints of one body.

    Attributes:
        x_link_m: (K, 3) in the axes of each one's link.
        link: (K,) number of its link within the body.
        size_m: longest side of the box around the body, with every joint at zero.
    """

    x_link_m: FloatArray
    link: IntArray
    size_m: float

    @classmethod
    def of(cls, spacecraft: Spacecraft) -> Keypoints:
        """The keypoints of a spacecraft."""
        low, high = spacecraft.bounds_body_m
        joints = [spacecraft.keypoint_joints.get(name) for name in spacecraft.keypoints_body_m]
        return cls(
            np.array([*spacecraft.keypoints_body_m.values()], float).reshape(-1, 3),
            np.array([spacecraft.link_of(joint) for joint in joints], dtype=np.int64),
            float((high - low).max()),
        )

    def seen(self, body: BodyState, camera: Camera) -> FloatArray:
        """(K, 3) where they are in camera axes when the camera's rows see them."""
        x_cam_m = np.empty_like(self.x_link_m)
        for link in np.unique(self.link):
            own = self.link == link
            x_cam_m[own] = seen_by_rows(body, camera, self.x_link_m[own], int(link))[0]
        return x_cam_m


@dataclass(frozen=True)
class _Band:
    """Rows that are treated as exposed at the same time.

    Attributes:
        moment: the rows and their time.
        box: the pixels that any body may touch in these rows of the image.
        of_bodies: the same for each body, in the image and in the field of the silhouette.
        craft: the bodies and their sunlight at that time.
        solids: the solids at that time.
    """

    moment: Moment
    box: PixelBox
    of_bodies: list[tuple[PixelBox, PixelBox]]
    craft: CraftState
    solids: list[SolidInView]


def _check_links(scene: Scene, craft: CraftState) -> None:
    """Refuse a state that is not of the scene's bodies and joints."""
    states = [body.articulation.links for body in craft.bodies]
    bodies = [len(spacecraft.joints) + 1 for spacecraft in scene.bodies]
    if states != bodies:
        raise ValueError(
            f"the state has {states} links by body, and the scene {bodies}; give the articulation of"
            " every joint, or make the scene of spacecraft.welded(())"
        )


def _numbers_about(scene: Scene, number: int) -> tuple[IntArray, IntArray]:
    """(P + 1,) and (T + 1,): index of each part and of each triangle in the scene about a body; −1
    last, for none."""
    body_of_part = scene.body_of_part
    order = np.argsort(body_of_part != number, kind="stable")
    parts = np.append(np.argsort(order), -1).astype(np.int16)
    faces = np.array([len(piece.part.faces) for piece in scene.pieces])
    own = np.repeat(body_of_part == number, faces)
    triangles = np.argsort(np.argsort(~own, kind="stable"))
    return parts, np.append(triangles, -1).astype(np.int32)


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
