"""One frame under test: its labels, and what they are compared with."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_arrays
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.body_case import BodyCase
from posse_core._evaluation.placed import JointsSaid
from posse_core._evaluation.raster import FirstHits, RayMeeting, first_hits, first_hits_by_rows
from posse_core._model.label_line import BodyLabels, LabelLine

ARRAYS = {
    "part_id": ("iu", ()),
    "body_id": ("iu", ()),
    "depth_m": ("f", ()),
    "normal_cam": ("f", (3,)),
    "base_color_rgb": ("f", (3,)),
    "optical_flow_px": ("f", (2,)),
    "flow_visible": ("b", ()),
    "scene_flow_m": ("f", (3,)),
}
"""Arrays by name: kinds of their type, and their axes beyond rows and columns."""
POSE = ("q_cam_from_body", "t_body_cam_m")
DEPTH_ERROR_M, DEPTH_ERROR_SHARE = 1e-3, 1e-5
"""How far a depth may lie from the mesh: so much, and that share of itself for single precision."""
ROW_STEP_PX = 0.01
"""By how much bodies may move in the image while rows of a rolling shutter are traced together."""


def depth_error_m(depth_m: FloatArray) -> FloatArray:
    """How far depths may lie from the mesh."""
    return DEPTH_ERROR_M + DEPTH_ERROR_SHARE * depth_m


class Case:
    """One frame under test: its labels, and what they are compared with, made when asked for.

    Bodies, parts, vertices and triangles are numbered through the scene, the target's first, as
    ``docs/labels.md`` numbers bodies and parts.
    """

    def __init__(self, dataset: Dataset, labels: LabelLine) -> None:
        self.dataset = dataset
        self.labels = labels
        self.camera = dataset.camera

    def has(self, *names: str) -> bool:
        """Whether the labels of these names were made of the target, and are not null."""
        return self.labels.has(*names) and all(getattr(self.labels, name) is not None for name in names)

    @property
    def beside(self) -> dict[str, BodyLabels]:
        """The labels of the bodies beside the target."""
        return self.labels.bodies if self.labels.has("bodies") else {}

    @cached_property
    def bodies(self) -> tuple[BodyCase, ...]:
        """The target, and the bodies beside it; the check ``schema`` has found the files of all."""
        name = self.labels.spacecraft
        craft, mesh = self.dataset.spacecraft_by_name[name], self.dataset.mesh(name)
        target = BodyCase(0, "", self.labels, self.camera, self.joints(), craft, mesh)
        others = (
            BodyCase(
                number,
                name,
                labels,
                self.camera,
                self.joints(name),
                self.dataset.bodies[name],
                self.dataset.body_mesh(name),
            )
            for number, (name, labels) in enumerate(self.beside.items(), 1)
        )
        return (target, *others)

    def joints(self, body: str = "") -> JointsSaid:
        """Joints of the target, or of a body beside it, as the labels have them."""
        labels = self.beside[body] if body else self.labels
        return labels.joints if labels.has("joints") else {}

    @property
    def target(self) -> BodyCase:
        """The target."""
        return self.bodies[0]

    @cached_property
    def arrays(self) -> dict[str, AnyArray]:
        """Arrays of the frame; empty where the run wrote none.

        Raises:
            InputError: the file is missing or damaged.
        """
        name = self.labels.truth
        return read_arrays(inside(self.dataset.folder, name)) if name else {}

    @cached_property
    def truth(self) -> dict[str, AnyArray]:
        """The arrays that are fit to be compared; the check ``files`` reports the others."""
        try:
            return {name: a for name, a in self.arrays.items() if not self.array_fault(name, a)}
        except InputError:
            return {}

    def array_fault(self, name: str, array: AnyArray) -> str | None:
        """What is wrong with the type or shape of an array, or None; one of another name is right."""
        kinds, axes = ARRAYS.get(name, (array.dtype.kind, array.shape[2:]))
        shape = (self.camera.height_px, self.camera.width_px, *axes)
        if array.dtype.kind in kinds and array.shape == shape:
            return None
        return (
            f"array {name} is {array.dtype} of shape {array.shape}, not as the camera and its name ask"
        )

    @cached_property
    def covered(self) -> BoolArray:
        """(H, W) the pixels that are in the mask of some body."""
        return np.asarray(np.any([body.mask for body in self.bodies], axis=0))

    @cached_property
    def following(self) -> Case | None:
        """The frame of the next index, if it is of the same sequence and bodies, and has a pose; None if
        there is none in the dataset, or its labels are damaged."""
        lines = self.dataset.label_lines
        place = int(np.searchsorted(lines.indices, self.labels.index + 1))
        if place == len(lines) or lines.indices[place] != self.labels.index + 1:
            return None
        try:
            case = Case(self.dataset, LabelLine.from_json(lines[place]))
        except InputError:
            return None
        is_same = case.labels.sequence == self.labels.sequence and case.described == self.described
        has_poses = all(each.has(*POSE) for each in (case.labels, *case.beside.values()))
        return case if is_same and has_poses else None

    @property
    def described(self) -> list[tuple[str, str]]:
        """Name and spacecraft of each body."""
        others = [(name, labels.spacecraft) for name, labels in self.beside.items()]
        return [("", self.labels.spacecraft), *others]

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """(P,) names of the parts."""
        return tuple(name for body in self.bodies for name in body.craft.parts)

    @cached_property
    def body_of_part(self) -> IntArray:
        """(P,) number of each part's body."""
        return np.repeat(np.arange(len(self.bodies)), [len(body.craft.parts) for body in self.bodies])

    @cached_property
    def link_of_part(self) -> IntArray:
        """(P,) number of each part's link within its body."""
        return np.concatenate([body.link_of_part for body in self.bodies])

    @cached_property
    def faces(self) -> IntArray:
        """(T, 3) vertices of each triangle."""
        first = np.cumsum([0, *(len(body.mesh.vertices_body_m) for body in self.bodies)])
        return np.concatenate(
            [body.mesh.faces + first[k] for k, body in enumerate(self.bodies)], dtype=np.int64
        )

    @cached_property
    def part_of_face(self) -> IntArray:
        """(T,) part of each triangle."""
        first = np.cumsum([0, *(len(body.craft.parts) for body in self.bodies)])
        return np.concatenate(
            [body.mesh.part_id + first[k] for k, body in enumerate(self.bodies)], dtype=np.int64
        )

    def vertices_m(self, after_s: float = 0.0) -> FloatArray:
        """(V, 3) all meshes in camera axes after a time, by the labels."""
        return np.concatenate([body.vertices_m(after_s) for body in self.bodies])

    def met_after(
        self, rays: FloatArray, after_s: FloatArray, origin_m: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """How far along each ray, in its own lengths, a mesh is first met: (N,), infinite for none.

        Args:
            rays: (N, 3) directions, camera axes.
            after_s: (N,) when each meets the meshes, after the frame's instant.
            origin_m: (3,) from where, camera axes.
        """
        lengths = np.full(len(rays), np.inf)
        for instant_s in np.unique(after_s):
            then = after_s == instant_s
            corners_m = (self.vertices_m(float(instant_s)) - np.asarray(origin_m))[self.faces]
            lengths[then] = RayMeeting(corners_m).lengths(rays[then])
        return lengths

    def hidden_by_m(self, points_cam_m: FloatArray, after_s: FloatArray) -> FloatArray:
        """By how much less planar depth a mesh is seen in front of points (N, 3), each at its time:
        (N,), negative where the mesh is beyond, −∞ where there is none."""
        return points_cam_m[:, 2] * (1 - self.met_after(points_cam_m, after_s))

    @cached_property
    def hits(self) -> FirstHits:
        """What the pixels show of the meshes by the labels, each row at its time; the groups of
        triangles are the bodies."""
        return self._hits(np.arange(len(self.faces)))

    def depth_of_part(self, part: int) -> FloatArray:
        """(H, W) planar depth of a part without all others, infinite off it."""
        return self._hits(np.flatnonzero(self.part_of_face == part)).depth_m

    def _hits(self, chosen: IntArray) -> FirstHits:
        """What the pixels show of some triangles."""
        faces, group = self.faces[chosen], self.body_of_part[self.part_of_face[chosen]]
        if self.camera.line_time_s == 0:
            return first_hits(self.camera, self.vertices_m(), faces, group)
        return first_hits_by_rows(
            self.camera, lambda row: self.vertices_m(float(self.target.row_s(row))), faces, group
        )

    @cached_property
    def turn_by_step_rad(self) -> FloatArray:
        """(H, W) by how much what a pixel shows may turn while rows are traced together: its link's
        border then moves by :data:`ROW_STEP_PX`, and a pixel is at most half of its size from it. 0
        without a rolling shutter."""
        if self.camera.line_time_s == 0:
            return np.zeros(self.hits.depth_m.shape)
        sizes_m = np.concatenate([body.link_sizes_m[body.link_of_part] for body in self.bodies])
        focal_px = min(self.camera.fx_px, self.camera.fy_px)
        return 2 * ROW_STEP_PX * self.hits.depth_m / (focal_px * np.append(sizes_m, 1)[self.part_seen])

    @cached_property
    def depth_error_m(self) -> FloatArray:
        """(H, W) how far a depth may lie from the mesh: :func:`depth_error_m`, and what it changes by
        while rows are traced together, since the surface is oblique and comes nearer."""
        depth_m = self.hits.depth_m
        if self.camera.line_time_s == 0:
            return depth_error_m(depth_m)
        shown_m = np.where(np.isfinite(depth_m), depth_m, np.nan)
        steps_m = [shown_m - np.roll(shown_m, shift, axis) for axis in (0, 1) for shift in (-1, 1)]
        slope_m = np.max(np.nan_to_num(np.abs(steps_m)), axis=0)
        error_m = depth_error_m(depth_m) + ROW_STEP_PX * slope_m
        return np.asarray(error_m + self.turn_by_step_rad * depth_m)

    @cached_property
    def part_seen(self) -> IntArray:
        """(H, W) part that each pixel shows by the labels' meshes; −1 for none."""
        return np.append(self.part_of_face, -1)[self.hits.face]

    @cached_property
    def body_seen(self) -> IntArray:
        """(H, W) number of the body that each pixel shows, likewise."""
        return np.append(self.body_of_part, -1)[self.part_seen]

    def normals_of_faces(self, face: IntArray, row: IntArray) -> FloatArray:
        """(N, 3) unit normals of triangles in camera axes, each when a row is exposed.

        Args:
            face: (N,) index of the triangle.
            row: (N,) the row.
        """
        after_s = self.target.row_s(row.astype(np.float64))
        normal = np.empty((len(face), 3))
        first_face = 0
        for body in self.bodies:
            faces, links = body.mesh.faces, body.vertex_links
            own = np.flatnonzero((face >= first_face) & (face < first_face + len(faces)))
            corners = faces[face[own] - first_face]
            a, b, c = (
                body.placed.in_camera(body.mesh.vertices_body_m[vertex], links[vertex], after_s[own])
                for vertex in corners.T
            )
            normal[own] = np.cross(b - a, c - a)
            first_face += len(faces)
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    @cached_property
    def part_shown(self) -> IntArray:
        """(H, W) part that each pixel shows as the array of parts says or, without it, as the meshes say
        where the labelled depth is theirs; −1 for none."""
        said = self.truth.get("part_id")
        if said is not None:
            return np.where((said >= 0) & (said < len(self.parts)), said, -1).astype(np.int64)
        depth_m = self.truth["depth_m"].astype(np.float64)
        is_mesh = np.abs(depth_m - self.hits.depth_m) <= self.depth_error_m
        return np.where(is_mesh, self.part_seen, -1)

    def by_link(self, row: IntArray, column: IntArray) -> Iterator[tuple[BodyCase, IntArray, IntArray]]:
        """Divide N pixels by the body that they show: each body, the indices of its pixels, and the
        number of the link that each shows. Pixels that show no known part are left out."""
        if len(self.bodies) == 1 and not self.target.craft.joints:
            yield self.target, np.arange(len(row)), np.zeros(len(row), dtype=np.int64)
            return
        part = self.part_shown[row, column]
        for body in self.bodies:
            own = np.flatnonzero((part >= 0) & (self.body_of_part[part] == body.number))
            yield body, own, self.link_of_part[part[own]]
