"""BOP: models, depth, masks and poses in millimetres (Hodaň et al. 2018, ``bop_datasets_format.md``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
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
from posse_core._files.text import json_object, text_file
from posse_core._formats.exported import ExportedBody, ExportedImage
from posse_core._formats.images import link_or_copy, write_png
from posse_core._formats.needs import labels_with
from posse_core._formats.rigid_objects import ObjectInView, RigidObjects, Silhouette
from posse_core._interfaces.writer import Writer
from posse_core._model.label_line import BodyLabels, Box, LabelLine

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
    frames are in ``train/``. The id of an image is the index of its frame. The objects are those of
    :class:`RigidObjects`; the origin of a model is that of its spacecraft, not the centre of its box.
    Each depth image has its own scale, by which the largest possible depth of what the image shows
    becomes the largest value.
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
        objects = RigidObjects(dataset)
        _write_models(objects, out / "models")
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


def _write_models(objects: RigidObjects, folder: Path) -> None:
    infos: dict[str, Any] = {}
    for each in objects.objects:
        vertices_mm = each.mesh.vertices_body_m * 1e3
        _write_ply(vertices_mm, each.mesh, folder / f"obj_{each.id:06d}.ply")
        low, size = vertices_mm.min(axis=0), np.ptp(vertices_mm, axis=0)
        infos[str(each.id)] = {
            "name": each.name,
            "diameter": 1e3 * each.mesh.diameter_m,
            **{f"min_{axis}": low[i] for i, axis in enumerate("xyz")},
            **{f"size_{axis}": size[i] for i, axis in enumerate("xyz")},
        }
        symmetries = [_homogeneous(R) for R in each.symmetries]
        if symmetries:
            infos[str(each.id)]["symmetries_discrete"] = symmetries
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


def _write_scene(dataset: Dataset, objects: RigidObjects, positions: list[int], scene: Path) -> None:
    pictures = "gray" if dataset.image(positions[0]).ndim == 2 else "rgb"
    for part in (pictures, "depth", "mask", "mask_visib"):
        (scene / part).mkdir(parents=True, exist_ok=True)
    with ExitStack() as files:
        add_camera, add_poses, add_infos = (
            files.enter_context(json_object(files.enter_context(text_file(scene / f"{name}.json"))))
            for name in ("scene_camera", "scene_gt", "scene_gt_info")
        )
        for labels in labels_with(dataset, "BOP", NEEDS, positions):
            index = labels.index
            link_or_copy(dataset.folder / labels.image, scene / pictures / f"{index:06d}.png")
            seen = list(objects.in_frame(labels))
            silhouettes = [each.silhouette() for each in seen]
            for number, (each, silhouette) in enumerate(zip(seen, silhouettes, strict=True)):
                name = f"{index:06d}_{number:06d}.png"
                write_png(scene / "mask" / name, silhouette.mask.astype(np.uint8) * 255)
                write_png(scene / "mask_visib" / name, each.mask.astype(np.uint8) * 255)
            scale_mm = _depth_scale_mm(seen)
            steps = _depth_steps(dataset, labels, scale_mm)
            write_png(scene / "depth" / f"{index:06d}.png", steps)
            cam_K = dataset.camera.matrix.ravel().tolist()
            add_camera(str(index), {"cam_K": cam_K, "depth_scale": scale_mm})
            add_poses(str(index), [_pose_record(each) for each in seen])
            infos = map(partial(_info_record, steps > 0), seen, silhouettes)
            add_infos(str(index), list(infos))


def _depth_scale_mm(seen: Sequence[ObjectInView]) -> float:
    """Return the millimetres per step, so that the spheres about what is shown fit the values."""
    shown = [each for each in seen if each.area_px] or seen
    farthest_m = max(max(each.t_object_cam_m[2], 0.0) + each.object.radius_m for each in shown)
    return float(farthest_m * 1e3 / DEPTH_STEPS)


def _depth_steps(dataset: Dataset, labels: LabelLine, scale_mm: float) -> IntArray:
    depth_m = dataset.depth(dataset.position(labels.index))
    steps = np.round(depth_m.astype(np.float64) * 1e3 / scale_mm)
    return np.asarray(np.nan_to_num(steps.clip(1, DEPTH_STEPS), nan=0), dtype=np.uint16)


def _pose_record(seen: ObjectInView) -> Any:
    R = frames.matrix_from_quaternion(np.array(seen.q_cam_from_object))
    return {
        "cam_R_m2c": R.ravel().tolist(),
        "cam_t_m2c": [x * 1e3 for x in seen.t_object_cam_m],
        "obj_id": seen.object.id,
    }


def _info_record(has_depth: BoolArray, seen: ObjectInView, silhouette: Silhouette) -> Any:
    """As BOP's ``calc_gt_info.py`` counts: a pixel is valid that has a depth, of whatever object, and
    the width of a box is the distance of its outermost pixels, one less than their number."""
    whole_px = silhouette.count_px
    return {
        "bbox_obj": _whole_box(silhouette),
        "bbox_visib": _NO_BOX if seen.box_px is None else _between_pixels(seen.box_px),
        "px_count_all": whole_px,
        "px_count_valid": int((silhouette.mask & has_depth).sum()),
        "px_count_visib": seen.area_px,
        "visib_fract": seen.area_px / whole_px if whole_px else 0.0,
    }


def _between_pixels(box_px: Sequence[float]) -> list[int]:
    x, y, width, height = map(int, box_px)
    return [x, y, width - 1, height - 1]


def _whole_box(silhouette: Silhouette) -> list[int]:
    """Return the box of a silhouette's pixels, also beyond the image.

    Where the silhouette ends inside the image it is that of its pixels; otherwise of the pixels whose
    centres are inside the box of the projected vertices.
    """
    if silhouette.box_px is None:
        return _NO_BOX
    mask = silhouette.mask
    if mask.any() and not (mask[[0, -1]].any() or mask[:, [0, -1]].any()):
        rows, columns = np.nonzero(mask)
        x0, y0 = int(columns.min()), int(rows.min())
        return [x0, y0, int(columns.max()) - x0, int(rows.max()) - y0]
    x, y, width, height = silhouette.box_px
    x0, y0 = int(np.ceil(x)), int(np.ceil(y))
    return [x0, y0, int(np.floor(x + width)) - x0, int(np.floor(y + height)) - y0]


def _visible_box(bbox: Sequence[int]) -> Box | None:
    if list(bbox) == _NO_BOX:
        return None
    x, y, width, height = bbox
    return Box(x, y, width + 1, height + 1)


def read_bop(folder: Path) -> Iterator[ExportedImage]:
    """Read the labels and arrays of every image in a folder ``bop``, in the form of a dataset's own."""
    infos = read_json(folder / "models" / "models_info.json")
    for scene in sorted(path.parent for path in folder.glob("*/*/scene_gt.json")):
        cameras, details = (read_json(scene / f"scene_{name}.json") for name in ("camera", "gt_info"))
        for id_, poses in read_json(scene / "scene_gt.json").items():
            name = f"{int(id_):06d}"
            steps = read_image(scene / "depth" / f"{name}.png").astype(np.float64)
            step_m = cameras[id_]["depth_scale"] / 1e3
            bodies = [
                ExportedBody(
                    _labels(infos, pose, detail),
                    read_image(scene / "mask_visib" / f"{name}_{number:06d}.png") > 0,
                )
                for number, (pose, detail) in enumerate(zip(poses, details[id_], strict=True))
            ]
            depth_m = np.where(steps > 0, steps * step_m, np.nan)
            yield ExportedImage(f"images/{name}.png", bodies, depth_m=depth_m, depth_step_m=step_m)


def _labels(infos: Mapping[str, Any], pose: Mapping[str, Any], detail: Mapping[str, Any]) -> BodyLabels:
    R = np.reshape(pose["cam_R_m2c"], (3, 3))
    return BodyLabels(
        spacecraft=infos[str(pose["obj_id"])]["name"],
        q_cam_from_body=frames.quaternion_from_matrix(R).tolist(),
        t_body_cam_m=tuple(x / 1e3 for x in pose["cam_t_m2c"]),
        box_visible_px=_visible_box(detail["bbox_visib"]),
        mask_area_px=detail["px_count_visib"],
    )


def labels_of_object(seen: ObjectInView) -> BodyLabels:
    """What the label lines say of an object, in the form of :func:`read_bop`."""
    return BodyLabels(
        spacecraft=seen.object.name,
        q_cam_from_body=seen.q_cam_from_object,
        t_body_cam_m=seen.t_object_cam_m,
        box_visible_px=seen.box_px,
        mask_area_px=seen.area_px,
    )
