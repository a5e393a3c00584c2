"""One frame under test: its labels, and what they are compared with."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core import _frames as frames
from posse_core._arrays import AnyArray, BoolArray, FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_arrays
from posse_core._dataset.layout import inside
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._evaluation.raster import depth_by_rows, depth_of_mesh
from posse_core._model.label_line import LabelLine

ARRAYS = {
    "part_id": ("iu", ()),
    "depth_m": ("f", ()),
    "normal_cam": ("f", (3,)),
    "base_color_rgb": ("f", (3,)),
    "optical_flow_px": ("f", (2,)),
    "flow_visible": ("b", ()),
    "scene_flow_m": ("f", (3,)),
}
"""Arrays by name: kinds of their type, and their axes beyond rows and columns."""
_ROW_TRIALS = 8


class Case:
    """One frame under test: its labels, and what they are compared with, made when asked for."""

    def __init__(self, dataset: Dataset, labels: LabelLine) -> None:
        self.dataset = dataset
        self.labels = labels
        self.camera = dataset.camera

    def has(self, *names: str) -> bool:
        """Whether the labels of these names were made, and are not null."""
        return self.labels.has(*names) and all(getattr(self.labels, name) is not None for name in names)

    @cached_property
    def craft(self) -> SpacecraftInfo:
        """What the labels speak of."""
        return self.dataset.spacecraft_by_name[self.labels.spacecraft]

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
    def mask(self) -> BoolArray:
        """(H, W) from the run lengths."""
        return self.labels.mask_rle.mask()

    @cached_property
    def R_cam_from_body(self) -> FloatArray:
        """(3, 3) from the pose."""
        return frames.matrix_from_quaternion(np.array(self.labels.q_cam_from_body, dtype=np.float64))

    def in_camera(
        self,
        x_body_m: FloatArray,
        R_cam_from_body: FloatArray | None = None,
        after_s: FloatArray | float = 0.0,
    ) -> FloatArray:
        """(N, 3) body → (N, 3) camera axes by the labelled pose, or with another rotation; moved on
        by the labelled rates for a time, one for all or (N,)."""
        R = self.R_cam_from_body if R_cam_from_body is None else R_cam_from_body
        after_s = np.broadcast_to(np.asarray(after_s)[..., None], (len(x_body_m), 1))
        body, camera, v = (after_s * rate for rate in self._rates)
        x_m = Rotation.from_rotvec(body).apply(x_body_m) @ R.T + np.array(self.labels.t_body_cam_m)
        return np.asarray(Rotation.from_rotvec(-camera).apply(x_m + v))

    def in_body(self, x_cam_m: FloatArray, after_s: FloatArray) -> FloatArray:
        """(N, 3) camera axes, each (N,) after the frame's instant → (N, 3) body axes; the inverse of
        :meth:`in_camera`."""
        body, camera, v = (after_s[:, None] * rate for rate in self._rates)
        x_m = Rotation.from_rotvec(camera).apply(x_cam_m) - v - np.array(self.labels.t_body_cam_m)
        return np.asarray(Rotation.from_rotvec(-body).apply(x_m @ self.R_cam_from_body))

    @cached_property
    def _rates(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(3,) labelled angular rates of body and camera, and velocity; zeros where they were not
        made."""
        labels, zeros = self.labels, (0.0, 0.0, 0.0)
        return (
            np.array(labels.omega_body_rad_s if labels.has("omega_body_rad_s") else zeros),
            np.array(labels.omega_camera_rad_s if labels.has("omega_camera_rad_s") else zeros),
            np.array(labels.v_body_cam_m_s if labels.has("v_body_cam_m_s") else zeros),
        )

    @cached_property
    def following(self) -> Case | None:
        """The frame of the next index, if it is of the same sequence and has a pose; None if there is
        none in the dataset, or its labels are damaged."""
        lines = self.dataset.label_lines
        place = int(np.searchsorted(lines.indices, self.labels.index + 1))
        if place == len(lines) or lines.indices[place] != self.labels.index + 1:
            return None
        try:
            case = Case(self.dataset, LabelLine.from_json(lines[place]))
        except InputError:
            return None
        has_pose = case.has("q_cam_from_body", "t_body_cam_m")
        return case if has_pose and case.labels.sequence == self.labels.sequence else None

    def row_s(self, row_px: FloatArray | float) -> FloatArray:
        """When rows are exposed, against the frame's instant; beyond the image, as at its border."""
        last = self.camera.height_px - 1
        return np.asarray((np.clip(row_px, 0, last) - last / 2) * self.camera.line_time_s)

    def seen_by_rows(self, x_body_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, 3) body → (N, 3) camera axes when the row that sees a point is exposed; (N,) when."""
        after_s = np.zeros(len(x_body_m))
        for _ in range(_ROW_TRIALS if self.camera.line_time_s > 0 else 0):
            v_px = self.camera.project(self.in_camera(x_body_m, after_s=after_s))[:, 1]
            after_s = self.row_s(np.nan_to_num(v_px))
        return self.in_camera(x_body_m, after_s=after_s), after_s

    @cached_property
    def keypoints(self) -> tuple[FloatArray, AnyArray]:
        """(K, 2) pixels, NaN for null, and (K,) visibility, in the craft's order."""
        points = [self.labels.keypoints[name] for name in self.craft.keypoints_body_m]
        uv = np.array([[np.nan if x is None else x for x in point[:2]] for point in points])
        return uv.reshape(-1, 2), np.array([point.visibility for point in points], dtype=np.int8)

    @cached_property
    def points_body_m(self) -> FloatArray:
        """(K, 3) the craft's keypoints."""
        return np.array(list(self.craft.keypoints_body_m.values())).reshape(-1, 3)

    @cached_property
    def keypoints_cam_m(self) -> FloatArray:
        """(K, 3) the craft's keypoints in camera axes by the labelled pose, when their rows see them."""
        return self.seen_by_rows(self.points_body_m)[0]

    @cached_property
    def vertices_cam_m(self) -> FloatArray:
        """(V, 3) the mesh in camera axes by the labelled pose, when its vertices' rows see them."""
        return self.seen_by_rows(self.mesh.vertices_body_m)[0]

    @cached_property
    def mesh(self) -> Mesh:
        """The craft's triangles."""
        return self.dataset.mesh(self.craft.name)

    @cached_property
    def mesh_depth_m(self) -> FloatArray:
        """(H, W) planar depth of the mesh by the labelled pose, infinite off it."""
        if self.camera.line_time_s == 0:
            return depth_of_mesh(self.camera, self.vertices_cam_m, self.mesh.faces)
        return depth_by_rows(
            self.camera,
            lambda row: self.in_camera(self.mesh.vertices_body_m, after_s=float(self.row_s(row))),
            self.mesh.faces,
        )

    @cached_property
    def size_m(self) -> float:
        """Longest side of the craft's axis-aligned box in the body frame."""
        vertices = self.mesh.vertices_body_m
        return float(np.max(np.ptp(vertices, axis=0)))
