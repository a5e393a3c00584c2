"""The links of a scene as solids that rays are traced on, each in axes of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._geometry.outline import edges_of, extent_px
from posse_core._geometry.rows import seen_by_rows
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles, dot, rotated
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState, CraftState, LinkPoses
from posse_core._model.hull import hull_points
from posse_core._model.scene import Scene


@dataclass(frozen=True, eq=False)
class Solid:
    """All triangles of one link; vectors and positions are in its axes, component first.

    Attributes:
        tracer: of the triangles.
        body: number of its body in the scene.
        link: number of the link within the body.
        scene_link: number of the link in the scene.
        vertices_link_m: (3, V).
        outer_link_m: (3, H) those of the convex hull.
        edges: (E, 2) vertex indices.
        part_id: (T + 1,) int16 part of each triangle, as in a view; −1 last, for rays that hit none.
        face: (T + 1,) int32 index of each triangle, likewise.
    """

    tracer: Tracer
    body: int
    link: int
    scene_link: int
    vertices_link_m: FloatArray
    outer_link_m: FloatArray
    edges: IntArray
    part_id: IntArray
    face: IntArray

    def in_camera(self, camera: Camera, poses: LinkPoses) -> FloatArray:
        """(3, n) in camera axes at one instant, the vertices that may be outermost in an image or in
        depth: those of the convex hull, or all if the lens bends straight edges."""
        R, t_m = poses.R_cam_from_link[self.scene_link], poses.t_link_cam_m[self.scene_link]
        outermost = self.outer_link_m if camera.distortion is None else self.vertices_link_m
        return np.asarray(rotated(R, outermost) + t_m[:, None])

    def seen(self, craft: CraftState, camera: Camera, poses: LinkPoses) -> FloatArray:
        """(3, n) the same vertices, each at the time of the row that sees it; all if rows see them at
        different times.

        Args:
            craft: at the frame's instant.
            camera: whose rows they are.
            poses: of the links at the frame's instant.
        """
        if camera.line_time_s == 0:
            return self.in_camera(camera, poses)
        body: BodyState = craft.bodies[self.body]
        return seen_by_rows(body, camera, self.vertices_link_m.T, self.link)[0].T

    def extent_px(self, camera: Camera, vertices_cam_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest image position, (2,) each, of vertices as by :meth:`in_camera` or
        :meth:`seen`; NaN if one is behind the camera or beyond the reach of its lens."""
        return extent_px(camera, vertices_cam_m.T, self.edges)


def solids_of(scene: Scene) -> tuple[Solid, ...]:
    """The solids of a scene's links, in the order of the links; links without a part have none."""
    links: dict[int, list[int]] = {}
    for index, piece in enumerate(scene.pieces):
        links.setdefault(piece.link, []).append(index)
    faces = [len(piece.part.faces) for piece in scene.pieces]
    first_face = np.cumsum([0, *faces])
    solids = []
    for scene_link in sorted(links):
        pieces = links[scene_link]
        parts = [scene.pieces[k].part for k in pieces]
        corners_m = np.concatenate([part.vertices_body_m[part.faces] for part in parts])
        part_id = np.repeat(np.array(pieces, dtype=np.int16), [faces[k] for k in pieces])
        low = np.min([part.vertices_body_m.min(axis=0) for part in parts], axis=0)
        high = np.max([part.vertices_body_m.max(axis=0) for part in parts], axis=0)
        triangles = Triangles.of_corners(corners_m, part_id, np.stack([low, high]))
        face = np.concatenate([first_face[k] + np.arange(faces[k]) for k in pieces])[triangles.face]
        firsts = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])
        vertices_m = np.concatenate([part.vertices_body_m for part in parts])
        body, link = scene.links[scene_link]
        solids.append(
            Solid(
                tracer=Tracer(triangles),
                body=body,
                link=link,
                scene_link=scene_link,
                vertices_link_m=np.ascontiguousarray(vertices_m.T),
                outer_link_m=np.ascontiguousarray(hull_points(vertices_m).T),
                edges=edges_of(
                    np.concatenate(
                        [first + part.faces for first, part in zip(firsts, parts, strict=False)]
                    )
                ),
                part_id=np.append(triangles.part_id, np.int16(-1)),
                face=np.append(face, -1).astype(np.int32),
            )
        )
    return tuple(solids)


@dataclass(frozen=True)
class Placed:
    """A solid at one instant, or at one instant for each of N rays.

    Positions in the solid's own axes are relative to the centre of its box, as in :class:`Tracer`.

    Attributes:
        solid: what is placed.
        R_cam_from_link: (3, 3) or (3, 3, N).
        t_link_cam_m: (3, 1) or (3, N).
    """

    solid: Solid
    R_cam_from_link: FloatArray
    t_link_cam_m: FloatArray

    @property
    def centre_cam_m(self) -> FloatArray:
        """(3, 1) or (3, N) centre of the solid's box in camera axes."""
        centre_m = self.solid.tracer.triangles.centre_body_m[:, None]
        return self.direction_in_camera(centre_m) + self.t_link_cam_m

    def may_shade(self, other: Placed, direction_cam: FloatArray) -> bool:
        """Whether the sphere around the solid may lie between that around another one and a light at
        infinity, in the direction (3, 1), at one instant; True where the instants differ."""
        if self.R_cam_from_link.ndim == 3 or direction_cam.shape[1] != 1:
            return True
        between_m = self.centre_cam_m - other.centre_cam_m
        along_m = float(dot(between_m, direction_cam)[0])
        reach_m = self.solid.tracer.triangles.size_m + other.solid.tracer.triangles.size_m
        return along_m > -reach_m and float(dot(between_m, between_m)[0]) - along_m**2 < reach_m**2

    def maybe_between(self, x_cam_m: FloatArray, direction_cam: FloatArray) -> IntArray:
        """Indices of those of N rays that pass the sphere around the solid, or begin in it.

        Args:
            x_cam_m: (3, N) where the rays begin.
            direction_cam: (3, 1) unit vector of all rays, or (3, N).
        """
        # No triangle is further from the centre of its box than the box's longest side.
        to_centre_m = self.centre_cam_m - x_cam_m
        along_m = dot(to_centre_m, direction_cam)
        apart_m2 = dot(to_centre_m, to_centre_m) - along_m**2
        size_m = self.solid.tracer.triangles.size_m
        return np.flatnonzero((apart_m2 <= size_m**2) & (along_m >= -size_m))

    def of_rays(self, rays: IntArray) -> Placed:
        """The same for some of the rays, by their indices (n,)."""
        if self.R_cam_from_link.ndim == 2:
            return self
        return replace(
            self,
            R_cam_from_link=self.R_cam_from_link[..., rays],
            t_link_cam_m=self.t_link_cam_m[:, rays],
        )

    def point_here(self, x_cam_m: FloatArray) -> FloatArray:
        """Points (3, N) in camera axes → own axes, relative to the centre."""
        centre_m = self.solid.tracer.triangles.centre_body_m[:, None]
        return self.direction_here(x_cam_m - self.t_link_cam_m) - centre_m

    def direction_here(self, d_cam: FloatArray) -> FloatArray:
        """Directions (3, N) in camera axes → own axes."""
        return rotated(np.swapaxes(self.R_cam_from_link, 0, 1), d_cam)

    def direction_in_camera(self, d: FloatArray) -> FloatArray:
        """Directions (3, N) in own axes → camera axes."""
        return rotated(self.R_cam_from_link, d)

    def point_in_camera(self, x_m: FloatArray) -> FloatArray:
        """Points (3, N) in own axes, relative to the centre → camera axes."""
        centre_m = self.solid.tracer.triangles.centre_body_m[:, None]
        return self.direction_in_camera(x_m + centre_m) + self.t_link_cam_m


def placed_at(solids: Sequence[Solid], poses: LinkPoses) -> tuple[Placed, ...]:
    """The solids at one instant."""
    return tuple(
        Placed(
            solid, poses.R_cam_from_link[solid.scene_link], poses.t_link_cam_m[solid.scene_link][:, None]
        )
        for solid in solids
    )


GRAZING = 1e-9
"""A face is on the Sun's side if the cosine between its normal and the Sun is greater: rounding alone
would decide for faces that are edge-on by construction, as those of a craft that points at the Sun."""


def shadowed(
    placed: Sequence[Placed],
    own: int,
    point_m: FloatArray,
    normal: FloatArray,
    sun_direction_cam: FloatArray,
) -> BoolArray:
    """Whether any solid lies between points of one of them and the Sun: (N,).

    Args:
        placed: all solids, for the same N rays.
        own: index of the solid that the points are on.
        point_m: (3, N) its axes, relative to its centre.
        normal: (3, N) unit normals on the side that is seen, likewise.
        sun_direction_cam: (3, 1) unit vector to the Sun, camera axes, or (3, N).
    """
    here = placed[own]
    found = here.solid.tracer.shadowed(point_m, normal, here.direction_here(sun_direction_cam))
    free = np.flatnonzero(~found)
    for k, other in enumerate(placed):
        if k == own or not len(free) or not other.may_shade(here, sun_direction_cam):
            continue
        x_cam_m = here.of_rays(free).point_in_camera(point_m[:, free])
        sun = sun_direction_cam if sun_direction_cam.shape[1] == 1 else sun_direction_cam[:, free]
        there = other.of_rays(free)
        near = there.maybe_between(x_cam_m, sun)
        if len(near):
            sun = sun if sun.shape[1] == 1 else sun[:, near]
            there = there.of_rays(near)
            starts_m, directions = there.point_here(x_cam_m[:, near]), there.direction_here(sun)
            blocked = near[_blocked(there.solid.tracer, starts_m, directions)]
            found[free[blocked]] = True
            free = np.delete(free, blocked)
    return found


def _blocked(tracer: Tracer, point_m: FloatArray, direction: FloatArray) -> BoolArray:
    """Whether a tracer's triangles lie on rays: (N,). The rays begin where single precision suffices."""
    directions = np.broadcast_to(direction, point_m.shape)
    skipped_m = np.maximum(0.0, -dot(point_m, directions) - tracer.triangles.size_m)
    return tracer.blocked(point_m + skipped_m * directions, directions)
