"""One body of a frame under test: its labels, and what they are compared with."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._evaluation.placed import JointsSaid, PlacedBody
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels

_ROW_TRIALS = 8


class BodyCase:
    """A body under test. What is compared with its labels is made when it is asked for.

    Attributes:
        number: of the body in the frame; 0 for the target.
        name: of the body; empty for the target.
        labels: of the body.
        camera: whose axes and pixels they are in.
        joints: the joints that move, as the labels have them.
        craft, mesh: what the body looks like.
        where: their files within the dataset, without the ending.
    """

    def __init__(
        self,
        number: int,
        name: str,
        labels: BodyLabels,
        camera: Camera,
        joints: JointsSaid,
        craft: SpacecraftInfo,
        mesh: Mesh,
    ) -> None:
        self.number, self.name = number, name
        self.labels, self.camera, self.joints = labels, camera, joints
        self.craft, self.mesh = craft, mesh
        self.where = f"{f'bodies/{name}' if number else 'spacecraft'}/{craft.name}"

    def has(self, *names: str) -> bool:
        """Whether the labels of these names were made, and are not null."""
        return self.labels.has(*names) and all(getattr(self.labels, name) is not None for name in names)

    @cached_property
    def mask(self) -> BoolArray:
        """(H, W) from the run lengths."""
        return self.labels.mask_rle.mask()

    @cached_property
    def R_cam_from_body(self) -> FloatArray:
        """(3, 3) from the pose."""
        return frames.matrix_from_quaternion(np.array(self.labels.q_cam_from_body, dtype=np.float64))

    @cached_property
    def placed(self) -> PlacedBody:
        """The body by its labelled pose, rates and joints; rates that were not made are zero."""
        labels, zeros = self.labels, (0.0, 0.0, 0.0)
        return PlacedBody(
            craft=self.craft,
            R_cam_from_body=self.R_cam_from_body,
            t_body_cam_m=np.array(labels.t_body_cam_m),
            omega_body_rad_s=np.array(
                labels.omega_body_rad_s if labels.has("omega_body_rad_s") else zeros
            ),
            omega_camera_rad_s=np.array(
                labels.omega_camera_rad_s if labels.has("omega_camera_rad_s") else zeros
            ),
            v_body_cam_m_s=np.array(labels.v_body_cam_m_s if labels.has("v_body_cam_m_s") else zeros),
            is_carried=labels.has("is_carried") and labels.is_carried,
            joints=self.joints,
        )

    def row_s(self, row_px: FloatArray | float) -> FloatArray:
        """When rows are exposed, against the frame's instant; beyond the image, as at its border."""
        last = self.camera.height_px - 1
        return np.asarray((np.clip(row_px, 0, last) - last / 2) * self.camera.line_time_s)

    def seen_by_rows(self, x_link_m: FloatArray, links: IntArray) -> tuple[FloatArray, FloatArray]:
        """(N, 3) axes of the links (N,) → (N, 3) camera axes when the row that sees a point is exposed;
        (N,) when."""
        after_s = np.zeros(len(x_link_m))
        for _ in range(_ROW_TRIALS if self.camera.line_time_s > 0 else 0):
            v_px = self.camera.project(self.placed.in_camera(x_link_m, links, after_s))[:, 1]
            after_s = self.row_s(np.nan_to_num(v_px))
        return self.placed.in_camera(x_link_m, links, after_s), after_s

    @cached_property
    def keypoints(self) -> tuple[FloatArray, AnyArray]:
        """(K, 2) pixels, NaN for null, and (K,) visibility, in the craft's order."""
        points = [self.labels.keypoints[name] for name in self.craft.keypoints_body_m]
        uv = np.array([[np.nan if x is None else x for x in point[:2]] for point in points])
        return uv.reshape(-1, 2), np.array([point.visibility for point in points], dtype=np.int8)

    @cached_property
    def points_m(self) -> FloatArray:
        """(K, 3) the craft's keypoints, with every joint at zero."""
        return np.array(list(self.craft.keypoints_body_m.values())).reshape(-1, 3)

    @cached_property
    def point_links(self) -> IntArray:
        """(K,) number of each keypoint's link."""
        carriers = self.craft.keypoint_joints
        return self._numbers([carriers.get(name) for name in self.craft.keypoints_body_m])

    @cached_property
    def keypoints_seen(self) -> tuple[FloatArray, FloatArray]:
        """(K, 3) the craft's keypoints in camera axes, when their rows see them; (K,) when."""
        return self.seen_by_rows(self.points_m, self.point_links)

    def keypoints_px(
        self, R_cam_from_body: FloatArray | None = None, joints: JointsSaid | None = None
    ) -> FloatArray:
        """(K, 2) where the keypoints would be at the frame's instant with another attitude, or with
        joints elsewhere."""
        placed = replace(
            self.placed,
            R_cam_from_body=self.R_cam_from_body if R_cam_from_body is None else R_cam_from_body,
            joints=self.joints if joints is None else joints,
        )
        return self.camera.project(placed.in_camera(self.points_m, self.point_links))

    @cached_property
    def link_of_part(self) -> IntArray:
        """(P,) number of each part's link."""
        return self._numbers([self.craft.part_joints.get(name) for name in self.craft.parts])

    @cached_property
    def vertex_links(self) -> IntArray:
        """(V,) number of each vertex' link."""
        links = np.zeros(len(self.mesh.vertices_body_m), dtype=np.int64)
        links[self.mesh.faces] = self.link_of_part[self.mesh.part_id][:, None]
        return links

    def _numbers(self, joints: list[str | None]) -> IntArray:
        known = [None, *(joint.name for joint in self.craft.joints)]
        return np.array([known.index(joint) for joint in joints], dtype=np.int64)

    def vertices_m(self, after_s: float = 0.0) -> FloatArray:
        """(V, 3) the mesh in camera axes after a time."""
        return self.placed.in_camera(self.mesh.vertices_body_m, self.vertex_links, after_s)

    @cached_property
    def vertices_seen_m(self) -> FloatArray:
        """(V, 3) the mesh in camera axes, when its vertices' rows see them."""
        return self.seen_by_rows(self.mesh.vertices_body_m, self.vertex_links)[0]

    @cached_property
    def link_sizes_m(self) -> FloatArray:
        """(L,) longest side of the box around each link, in its axes; 0 of one without a part."""
        sizes_m = np.zeros(len(self.craft.joints) + 1)
        for link in np.unique(self.vertex_links):
            own_m = self.mesh.vertices_body_m[self.vertex_links == link]
            sizes_m[link] = np.ptp(own_m, axis=0).max()
        return sizes_m

    @cached_property
    def size_m(self) -> float:
        """Longest side of the craft's axis-aligned box in the body frame, with every joint at zero."""
        return float(np.max(np.ptp(self.mesh.vertices_body_m, axis=0)))
