"""One frame under test: its labels, and what they are compared with."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from posse_core import frames
from posse_core.dataset import Dataset, SpacecraftInfo, read_arrays
from posse_core.errors import InputError
from posse_core.evaluation.raster import depth_of_mesh
from posse_core.formats.rle import decode_rle
from posse_core.model.arrays import AnyArray, BoolArray, FloatArray

ARRAYS = {"part_id": ("iu", ()), "depth_m": ("f", ()), "normal_cam": ("f", (3,))}
"""Arrays by name: kinds of their type, and their axes beyond rows and columns."""


class Case:
    """One frame under test: its labels, and what they are compared with, made when asked for."""

    def __init__(self, dataset: Dataset, labels: dict[str, Any]) -> None:
        self.dataset = dataset
        self.labels = labels
        self.camera = dataset.camera

    @cached_property
    def craft(self) -> SpacecraftInfo:
        """What the labels speak of."""
        return self.dataset.spacecraft_by_name[self.labels["spacecraft"]]

    @cached_property
    def arrays(self) -> dict[str, AnyArray]:
        """Arrays of the frame; empty where the run wrote none.

        Raises:
            InputError: the file is missing or damaged.
        """
        name = self.labels["truth"]
        return read_arrays(self.dataset.folder / name) if name else {}

    @cached_property
    def truth(self) -> dict[str, AnyArray]:
        """The arrays that are fit to be compared; the check ``files`` tells of the others."""
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
        return decode_rle(self.labels["mask_rle"])

    @cached_property
    def R_cam_from_body(self) -> FloatArray:
        """(3, 3) from the pose."""
        return frames.matrix_from_quaternion(np.array(self.labels["q_cam_from_body"], dtype=np.float64))

    def in_camera(self, x_body_m: FloatArray, R_cam_from_body: FloatArray | None = None) -> FloatArray:
        """(N, 3) body → (N, 3) camera axes by the labelled pose, or with another rotation."""
        R = self.R_cam_from_body if R_cam_from_body is None else R_cam_from_body
        return np.asarray(x_body_m @ R.T + np.array(self.labels["t_body_cam_m"]))

    @cached_property
    def keypoints(self) -> tuple[FloatArray, AnyArray]:
        """(K, 2) pixels, NaN for null, and (K,) visibility, in the craft's order."""
        rows = [self.labels["keypoints"][name] for name in self.craft.keypoints_body_m]
        uv = np.array([[np.nan if x is None else x for x in row[:2]] for row in rows]).reshape(-1, 2)
        return uv, np.array([row[2] for row in rows], dtype=np.int8)

    @cached_property
    def points_body_m(self) -> FloatArray:
        """(K, 3) the craft's keypoints."""
        return np.array(list(self.craft.keypoints_body_m.values())).reshape(-1, 3)

    @cached_property
    def keypoints_cam_m(self) -> FloatArray:
        """(K, 3) the craft's keypoints in camera axes by the labelled pose."""
        return self.in_camera(self.points_body_m)

    @cached_property
    def vertices_cam_m(self) -> FloatArray:
        """(V, 3) the mesh in camera axes by the labelled pose."""
        return self.in_camera(self.dataset.mesh(self.craft.name).vertices_body_m)

    @cached_property
    def mesh_depth_m(self) -> FloatArray:
        """(H, W) planar depth of the mesh by the labelled pose, infinite off it."""
        faces = self.dataset.mesh(self.craft.name).faces
        return depth_of_mesh(self.camera, self.vertices_cam_m, faces)

    @cached_property
    def size_m(self) -> float:
        """Longest side of the craft's axis-aligned box in the body frame."""
        vertices = self.dataset.mesh(self.craft.name).vertices_body_m
        return float(np.max(np.ptp(vertices, axis=0)))
