"""nerfstudio: ``transforms.json`` with the camera's pose in each image, and a cloud of sparse points
(https://docs.nerf.studio/quickstart/data_conventions.html).

The world is the spacecraft: its axes are the body axes. Camera axes are OpenGL's. The centre of the
top-left pixel is (0.5, 0.5), as nerfstudio places its rays, so half a pixel is added to the principal
point.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posse_core import _frames as frames
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image, read_json
from posse_core._dataset.layout import PARTS
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._files.text import text_file, write_items
from posse_core._formats.exported import ExportedBody, ExportedImage
from posse_core._formats.needs import refuse_rational_lens
from posse_core._formats.sparse_points import SparsePoints, sparse_points
from posse_core._formats.static_world import frames_by_spacecraft, write_images
from posse_core._interfaces.writer import Writer
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels, LabelLine

PIXEL_CENTRE = 0.5
"""Position of the centre of the first pixel."""
_PLY = "sparse_points.ply"
_PLY_HEADER = """ply
format binary_little_endian 1.0
comment body axes, metres
element vertex {points}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
end_header
"""
_POINT = np.dtype([("x", "<f4", (3,)), ("rgb", "u1", (3,))])
_PART_KEYS = dict(zip(PARTS, ("train_filenames", "val_filenames", "test_filenames"), strict=True))


class NerfstudioWriter(Writer):
    """Writes a folder ``nerfstudio/NAME`` for each spacecraft, with ``transforms.json``, ``images/``,
    ``masks/`` and ``sparse_points.ply``.

    If the dataset has been divided into parts, the file lists the images of each.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``nerfstudio``.

        Raises:
            InputError: The camera has a rolling shutter or a rational lens, or a frame lacks a label.
        """
        refuse_rational_lens(dataset.camera, f"{dataset.folder}: nerfstudio")
        for name, positions in frames_by_spacecraft(dataset, "nerfstudio").items():
            out = folder / "nerfstudio" / name
            write_images(dataset, positions, out)
            _write_points(sparse_points(dataset, positions), out / _PLY)
            header = {
                **_intrinsics(dataset.camera),
                "applied_transform": np.eye(4)[:3].tolist(),
                "ply_file_path": _PLY,
                **_parts(dataset, positions),
            }
            with text_file(out / "transforms.json") as text:
                members = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in header.items())
                text.write("{" + ",\n".join(members) + ',\n"frames": ')
                write_items(text, (_frame(dataset[position]) for position in positions))
                text.write("}\n")
        return [folder / "nerfstudio"]


def _intrinsics(camera: Camera) -> dict[str, Any]:
    fisheye = camera.distortion is not None and camera.distortion.model == "fisheye"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    return {
        "camera_model": "OPENCV_FISHEYE" if fisheye else "OPENCV",
        "w": camera.width_px,
        "h": camera.height_px,
        "fl_x": camera.fx_px,
        "fl_y": camera.fy_px,
        "cx": camera.cx_px + PIXEL_CENTRE,
        "cy": camera.cy_px + PIXEL_CENTRE,
        **dict(sorted(zip(names, camera.distortion_coefficients.tolist(), strict=True))),
    }


def _parts(dataset: Dataset, positions: Sequence[int]) -> dict[str, list[str]]:
    """The images of each part by nerfstudio's key; nothing if the dataset has not been divided."""
    if not dataset.is_divided:
        return {}
    ours = set(positions)
    return {
        key: [f"images/{_name(dataset[i])}" for i in dataset.part(part) if i in ours]
        for part, key in _PART_KEYS.items()
    }


def _name(labels: LabelLine) -> str:
    return Path(labels.image).name


def _frame(labels: LabelLine) -> dict[str, Any]:
    R_body_from_cam = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body)).T
    pose = np.eye(4)
    pose[:3, :3] = R_body_from_cam @ frames.R_GL_FROM_CAM.T
    pose[:3, 3] = -R_body_from_cam @ np.array(labels.t_body_cam_m)
    return {
        "file_path": f"images/{_name(labels)}",
        "mask_path": f"masks/{_name(labels)}",
        "transform_matrix": pose.tolist(),
    }


def _write_points(points: SparsePoints, path: Path) -> None:
    rows = np.empty(len(points.x_body_m), _POINT)
    rows["x"], rows["rgb"] = points.x_body_m, points.color_rgb
    write_bytes(path, _PLY_HEADER.format(points=len(rows)).encode() + rows.tobytes())


def read_nerfstudio(folder: Path, camera: Camera) -> Iterator[ExportedImage]:
    """Read the pose and the mask of every image of a folder ``nerfstudio``.

    Raises:
        InputError: A camera is not that of the dataset.
    """
    for scene in sorted(path for path in folder.iterdir() if path.is_dir()):
        path = scene / "transforms.json"
        value = read_json(path)
        for key, number in _intrinsics(camera).items():
            if value.get(key) != number:
                raise InputError(f"{path}: {key} is {value.get(key)}, the dataset's camera has {number}")
        for frame in value["frames"]:
            pose = np.array(frame["transform_matrix"])
            R_cam_from_body = frames.R_GL_FROM_CAM.T @ pose[:3, :3].T
            labels = BodyLabels(
                spacecraft=scene.name,
                q_cam_from_body=frames.quaternion_from_matrix(R_cam_from_body).tolist(),
                t_body_cam_m=(-R_cam_from_body @ pose[:3, 3]).tolist(),
            )
            mask = read_image(scene / frame["mask_path"]) > 0
            yield ExportedImage(frame["file_path"], [ExportedBody(labels, mask)])
