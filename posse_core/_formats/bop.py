"""BOP: models, depth, masks and poses in millimetres (Hodaň et al. 2018, ``bop_datasets_format.md``)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image, read_json
from posse_core._dataset.layout import PARTS
from posse_core._dataset.mesh import Mesh
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes, write_json
from posse_core._files.text import text_file, write_members
from posse_core._formats.images import link_or_copy, write_png
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.label_line import Box, LabelLine

NEEDS = ("q_cam_from_body", "t_body_cam_m", "mask_rle", "box_visible_px", "box_whole_px")
DEPTH_STEPS = 65535
"""Largest value of a 16-bit depth image; 0 means no depth."""
_FOLDERS = dict(zip(PARTS, ("train", "val", "test"), strict=True))
_NO_BOX = [-1, -1, -1, -1]
_PLY_HEADER = """ply
format binary_little_endian 1.0
comment body frame, millimetres
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


class BopWriter(Writer):
    """Writes ``bop/``: ``camera.json``, ``models/`` and the scenes.

    There is one scene ``000000`` in each of ``train/``, ``val/`` and ``test/``; without a partition all
    frames are in ``train/``. The id of an image is the index of its frame. The id of an object is its
    number in alphabetical order, counted from 1. The origin of the model is the centre of mass, not the
    centre of its box. Each depth image has its own scale, by which the largest possible depth of the
    spacecraft becomes the largest value.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``bop``.

        Raises:
            InputError: The camera's lens has distortion, or a frame lacks a label.
        """
        if dataset.camera.distortion is not None:
            raise InputError(
                f"{dataset.folder}: BOP supports pinhole cameras only, but camera.distortion is"
                f" {dataset.camera.distortion_coefficients.tolist()}; export coco or speed, or make the"
                " dataset without distortion"
            )
        out = folder / "bop"
        (out / "models").mkdir(parents=True, exist_ok=True)
        objects = {name: i for i, name in enumerate(sorted(dataset.spacecraft_by_name), 1)}
        _write_models(dataset, objects, out / "models")
        parts = {"train": list(range(len(dataset)))}
        if dataset.is_divided:
            parts = {_FOLDERS[part]: dataset.part(part) for part in PARTS}
        scenes = {out / name / "000000": positions for name, positions in parts.items() if positions}
        for scene, positions in scenes.items():
            _write_scene(dataset, objects, positions, scene)
        camera = dataset.camera
        value = {
            "cx": camera.cx_px,
            "cy": camera.cy_px,
            "depth_scale": 1.0,
            "fx": camera.fx_px,
            "fy": camera.fy_px,
            "height": camera.height_px,
            "width": camera.width_px,
        }
        write_json(out / "camera.json", value)
        return [out / "camera.json", out / "models", *scenes]


def _write_models(dataset: Dataset, objects: dict[str, int], folder: Path) -> None:
    infos: dict[str, Any] = {}
    for name, id_ in objects.items():
        mesh = dataset.mesh(name)
        vertices_mm = mesh.vertices_body_m * 1e3
        _write_ply(vertices_mm, mesh, folder / f"obj_{id_:06d}.ply")
        low, size = vertices_mm.min(axis=0), np.ptp(vertices_mm, axis=0)
        infos[str(id_)] = {
            "name": name,
            "diameter": 1e3 * mesh.diameter_m,
            **{f"min_{axis}": low[i] for i, axis in enumerate("xyz")},
            **{f"size_{axis}": size[i] for i, axis in enumerate("xyz")},
        }
        symmetries = [_homogeneous(R) for R in dataset.spacecraft_by_name[name].symmetries]
        if symmetries:
            infos[str(id_)]["symmetries_discrete"] = symmetries
    write_json(folder / "models_info.json", infos)


def _write_ply(vertices_mm: FloatArray, mesh: Mesh, path: Path) -> None:
    faces = np.empty(len(mesh.faces), np.dtype([("count", "u1"), ("vertices", "<i4", (3,))]))
    faces["count"], faces["vertices"] = 3, mesh.faces
    header = _PLY_HEADER.format(vertices=len(vertices_mm), faces=len(faces))
    write_bytes(path, header.encode() + vertices_mm.astype("<f4").tobytes() + faces.tobytes())


def _homogeneous(R: FloatArray) -> list[float]:
    T = np.eye(4)
    T[:3, :3] = R
    flat: list[float] = T.ravel().tolist()
    return flat


def _write_scene(dataset: Dataset, objects: dict[str, int], positions: list[int], scene: Path) -> None:
    pictures = "gray" if dataset.image(positions[0]).ndim == 2 else "rgb"
    for part in (pictures, "depth", "mask", "mask_visib"):
        (scene / part).mkdir(parents=True, exist_ok=True)
    for labels in labels_with(dataset, "BOP", NEEDS, positions):
        index = labels.index
        link_or_copy(dataset.folder / labels.image, scene / pictures / f"{index:06d}.png")
        mask = labels.mask_rle.mask().astype(np.uint8) * 255
        for part in ("mask", "mask_visib"):
            write_png(scene / part / f"{index:06d}_000000.png", mask)
        write_png(scene / "depth" / f"{index:06d}.png", _depth_steps(dataset, labels))
    records: dict[str, Callable[[Dataset, LabelLine, dict[str, int]], Any]] = {
        "scene_camera": _camera_record,
        "scene_gt": _pose_record,
        "scene_gt_info": _info_record,
    }
    for name, record in records.items():
        with text_file(scene / f"{name}.json") as text:
            write_members(text, _members(dataset, objects, positions, record))


def _members(
    dataset: Dataset,
    objects: dict[str, int],
    positions: list[int],
    record: Callable[[Dataset, LabelLine, dict[str, int]], Any],
) -> Iterator[tuple[str, Any]]:
    for labels in labels_with(dataset, "BOP", NEEDS, positions):
        yield str(labels.index), record(dataset, labels, objects)


def _depth_scale_mm(dataset: Dataset, labels: LabelLine) -> float:
    """Return the millimetres per step, so that the sphere about the spacecraft fits the values."""
    vertices = dataset.mesh(labels.spacecraft).vertices_body_m
    radius_m = float(np.sqrt((vertices**2).sum(axis=1).max()))
    farthest_m = max(labels.t_body_cam_m[2], 0.0) + radius_m
    return float(farthest_m * 1e3 / DEPTH_STEPS)


def _depth_steps(dataset: Dataset, labels: LabelLine) -> IntArray:
    arrays = dataset.truth(dataset.position(labels.index))
    if "depth_m" not in arrays:
        raise InputError(
            f"{dataset.folder}: frame {labels.index} has no depth, which BOP needs;"
            " add 'depth' to the scenario's annotators"
        )
    steps = np.round(arrays["depth_m"].astype(np.float64) * 1e3 / _depth_scale_mm(dataset, labels))
    return np.asarray(np.nan_to_num(steps.clip(1, DEPTH_STEPS), nan=0), dtype=np.uint16)


def _camera_record(dataset: Dataset, labels: LabelLine, objects: dict[str, int]) -> Any:
    return {
        "cam_K": dataset.camera.matrix.ravel().tolist(),
        "depth_scale": _depth_scale_mm(dataset, labels),
    }


def _pose_record(dataset: Dataset, labels: LabelLine, objects: dict[str, int]) -> Any:
    R = frames.matrix_from_quaternion(np.array(labels.q_cam_from_body))
    return [
        {
            "cam_R_m2c": R.ravel().tolist(),
            "cam_t_m2c": [x * 1e3 for x in labels.t_body_cam_m],
            "obj_id": objects[labels.spacecraft],
        }
    ]


def _info_record(dataset: Dataset, labels: LabelLine, objects: dict[str, int]) -> Any:
    area, share = labels.mask_area_px, labels.fraction_visible
    return [
        {
            "bbox_obj": _pixels_of(labels.box_whole_px),
            "bbox_visib": labels.box_visible_px or _NO_BOX,
            "px_count_all": round(area / share) if share else 0,
            "px_count_valid": area,
            "px_count_visib": area,
            "visib_fract": share or 0.0,
        }
    ]


def _pixels_of(box_px: Box | None) -> list[int]:
    """Return the box of the pixels whose centres are inside a box of projected vertices."""
    if box_px is None:
        return _NO_BOX
    x, y, width, height = box_px
    x0, y0 = int(np.ceil(x)), int(np.ceil(y))
    return [x0, y0, int(np.floor(x + width)) - x0 + 1, int(np.floor(y + height)) - y0 + 1]


def read_bop(folder: Path) -> Iterator[tuple[LabelLine, dict[str, FloatArray | BoolArray]]]:
    """Read the labels and arrays of every image in a folder ``bop``, in the form of a dataset's own.

    The arrays are ``mask`` (H, W) bool, ``depth_m`` (H, W), which is NaN without depth, and
    ``depth_step_m`` (), the resolution of the depth.
    """
    infos = read_json(folder / "models" / "models_info.json")
    for scene in sorted(path.parent for path in folder.glob("*/*/scene_gt.json")):
        cameras, details = (read_json(scene / f"scene_{name}.json") for name in ("camera", "gt_info"))
        for id_, (pose,) in read_json(scene / "scene_gt.json").items():
            name = f"{int(id_):06d}"
            (detail,) = details[id_]
            R = np.reshape(pose["cam_R_m2c"], (3, 3))
            steps = read_image(scene / "depth" / f"{name}.png").astype(np.float64)
            step_m = cameras[id_]["depth_scale"] / 1e3
            labels = LabelLine(
                index=int(id_),
                image=f"images/{name}.png",
                spacecraft=infos[str(pose["obj_id"])]["name"],
                q_cam_from_body=frames.quaternion_from_matrix(R).tolist(),
                t_body_cam_m=tuple(x / 1e3 for x in pose["cam_t_m2c"]),
                box_visible_px=None if detail["bbox_visib"] == _NO_BOX else detail["bbox_visib"],
                mask_area_px=detail["px_count_visib"],
            )
            arrays: dict[str, FloatArray | BoolArray] = {
                "mask": read_image(scene / "mask_visib" / f"{name}_000000.png") > 0,
                "depth_m": np.where(steps > 0, steps * step_m, np.nan),
                "depth_step_m": np.array(step_m),
            }
            yield labels, arrays
