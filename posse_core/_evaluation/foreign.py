"""Labels of another origin, in COCO, SPEED, BOP or YOLO-pose: what can be proven of them by themselves.

A frame's number in a fault is the image's id; where a format has none, its position in the list, from 0
(SPEED), or among all images by name (YOLO). Masks and depths that another program made are allowed to
differ from the model at the outline.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import ValidationError

from posse_core._arrays import BoolArray, FloatArray
from posse_core._dataset.camera import read_camera
from posse_core._dataset.coco_file import CocoAnnotation, CocoCategory, CocoFile, CocoImage, Id
from posse_core._dataset.files import read_image
from posse_core._errors import InputError
from posse_core._evaluation.foreign_files import (
    POSITION,
    BopCamera,
    BopCameras,
    BopPose,
    BopPoses,
    SpeedFile,
    SpeedPose,
    YoloData,
)
from posse_core._evaluation.raster import depth_of_mesh
from posse_core._evaluation.result import Fault, Report, Result
from posse_core._files.reading import parsed_json, read_bytes, read_record, read_text, record_of
from posse_core._model.camera import Camera
from posse_core._model.label_line import first_fault
from posse_core._model.labels import NOT_IN_FRAME, VISIBLE
from posse_core._model.run_lengths import RunLengths

ROUNDED_NUMBER_ERROR = 1e-3
"""How far off another program's numbers about 1 may be, since files may hold four digits: the length of
a quaternion, the elements of a rotation, shares of the image."""
MASK_SHARE, MASK_PX = 0.9, 4
"""Least share of a mask that must be on its model; where nothing else is in the image, also of the
model that must be on the mask. So many pixels may be off in any case."""
DEPTH_ERROR_MM = 15.0
"""BOP's own tolerance of depths (delta in its calc_gt_info)."""
_IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def validate_foreign(path: Path) -> Report | None:
    """Check labels that are not a dataset of POSSE's; None where they are not of a kind known here.

    Raises:
        InputError: a file is not JSON, or lacks what its format asks for.
    """
    if (path / "models" / "models_info.json").exists():
        results = _bop(path)
    elif (path / "data.yaml").exists():
        results = _yolo(path)
    elif path.is_file():
        results = _json_file(path)
    else:
        return None
    return Report(path, results[0].checked, tuple(results))


def _json_file(path: Path) -> list[Result]:
    text = read_bytes(path)
    value = parsed_json(text, str(path))
    if isinstance(value, dict) and {"images", "annotations", "categories"} <= value.keys():
        return _coco(path, record_of(text, CocoFile, f"{path}: not a COCO file"))
    if isinstance(value, list) and value and isinstance(value[0], dict) and POSITION in value[0]:
        return _speed(path, record_of(text, SpeedFile, f"{path}: not a file of SPEED").root)
    raise InputError(f"{path}: neither a COCO file nor one of SPEED; name one, or a folder")


def _coco(path: Path, value: CocoFile) -> list[Result]:
    files = Result("files", "every image is there and of its size", len(value.images))
    ids = Result("ids", "ids are unique and lead somewhere", len(value.annotations))
    boxes = Result("boxes", "boxes lie in the image, and around their mask")
    points = Result("keypoints", "keypoints are of their category, in the image, and counted right")
    images = {image.id: image for image in value.images}
    categories = {category.id: category for category in value.categories}
    if len(images) < len(value.images):
        ids.faults.append(Fault(None, "two images have one id"))
    for image in value.images:
        fault = _image_fault(path.parent / image.file_name, (image.height, image.width))
        files.faults += [Fault(_frame(image.id), fault)] if fault else []
    seen: set[Id] = set()
    for annotation in value.annotations:
        id_, frame = annotation.id, _frame(annotation.image_id)
        if id_ in seen or id_ == 0:
            ids.faults.append(Fault(frame, f"annotation id {id_} is {'0' if id_ == 0 else 'taken'}"))
        seen.add(id_)
        if annotation.image_id not in images or annotation.category_id not in categories:
            ids.faults.append(Fault(frame, f"annotation {id_} is of no image, or of no category"))
            continue
        image = images[annotation.image_id]
        boxes.checked += 1
        boxes.faults += [Fault(frame, text) for text in _box_faults(annotation, image)]
        if annotation.keypoints is not None:
            points.checked += 1
            texts = _keypoint_faults(annotation, image, categories[annotation.category_id])
            points.faults += [Fault(frame, text) for text in texts]
    return [files, ids, boxes, points]


def _frame(id_: Id) -> int | None:
    """The image's number; an id may also be a name."""
    return id_ if isinstance(id_, int) else None


def _image_fault(path: Path, shape: tuple[int, int]) -> str | None:
    try:
        size = read_image(path).shape[:2]
    except InputError as error:
        return str(error)
    return (
        None if size == shape else f"{path.name} is {size[1]} x {size[0]}, not {shape[1]} x {shape[0]}"
    )


def _box_faults(annotation: CocoAnnotation, image: CocoImage) -> Iterator[str]:
    x, y, width, height = box = annotation.bbox
    if not (width > 0 and height > 0):
        yield f"the box {list(box)} has no area"
    elif min(x, y) < -1 or x + width > image.width + 1 or y + height > image.height + 1:
        yield f"the box {list(box)} leaves the image"
    rle = annotation.segmentation
    if isinstance(rle, dict) and isinstance(rle.get("counts"), str):
        try:
            mask = RunLengths(**rle).mask()
        except ValidationError as error:
            yield f"the mask: {first_fault(error)}"
            return
        except ValueError as error:
            yield str(error)
            return
        if np.abs(np.array(_box_of(mask)) - box).max() > 1:
            yield f"the box is {list(box)}, the mask's {_box_of(mask)}"
        if annotation.area != mask.sum():
            yield f"the area is {annotation.area}, the mask's {mask.sum()}"


def _box_of(mask: BoolArray) -> list[int]:
    v, u = np.nonzero(mask)
    return [int(u.min()), int(v.min()), int(np.ptp(u)) + 1, int(np.ptp(v)) + 1] if len(u) else [-1] * 4


def _keypoint_faults(
    annotation: CocoAnnotation, image: CocoImage, category: CocoCategory
) -> Iterator[str]:
    numbers = annotation.keypoints or []
    if len(numbers) != 3 * len(category.keypoints):
        yield f"{len(numbers)} numbers are not three a keypoint of {category.name!r}"
        return
    points = np.reshape(np.array(numbers, dtype=np.float64), (-1, 3))
    labelled = points[:, 2] != NOT_IN_FRAME
    if not np.isin(points[:, 2], range(VISIBLE + 1)).all():
        yield "a visibility is none of 0, 1, 2"
    if annotation.num_keypoints != labelled.sum():
        yield f"num_keypoints is {annotation.num_keypoints}, {labelled.sum()} are labelled"
    uv = points[labelled, :2]
    if np.any(uv < -0.5) or np.any(uv > [image.width + 0.5, image.height + 0.5]):
        yield "a labelled keypoint is outside the image"


def _speed(path: Path, entries: Sequence[SpeedPose]) -> list[Result]:
    poses = Result("pose", "unit quaternions, targets before the camera", len(entries))
    names = Result("ids", "no image is listed twice", len(entries))
    camera_file = path.parent / "camera.json"
    camera = read_camera(camera_file) if camera_file.exists() else None
    aim = Result("aim", "the target's origin is near the image", len(entries) if camera else 0)
    seen: set[str] = set()
    for i, entry in enumerate(entries):
        q = np.array(entry.q_cam_from_body, dtype=np.float64)
        r_m = np.array(entry.t_body_cam_m, dtype=np.float64)
        if q.shape != (4,) or not abs(np.linalg.norm(q) - 1) < ROUNDED_NUMBER_ERROR:
            poses.faults.append(Fault(i, f"{entry.filename}: the quaternion is not of length 1"))
        if r_m.shape != (3,) or not r_m[2] > 0:
            poses.faults.append(Fault(i, f"{entry.filename}: the target is not before the camera"))
        elif camera and not _near(camera, camera.project(r_m)):
            aim.faults.append(Fault(i, f"{entry.filename}: the target is far outside the image"))
        if entry.filename in seen:
            names.faults.append(Fault(i, f"{entry.filename}: listed twice"))
        seen.add(entry.filename)
    return [poses, names, aim]


def _near(camera: Camera, uv: FloatArray) -> bool:
    """Within the image and three times as much around it."""
    size = np.array([camera.width_px, camera.height_px])
    return bool(np.all(uv > -3 * size) and np.all(uv < 4 * size))


def _bop(folder: Path) -> list[Result]:
    poses = Result("pose", "rotations are proper, positions finite")
    masks = Result("mask", f"{MASK_SHARE:.0%} of each mask is its model's outline by the pose")
    depths = Result("depth", f"depth is the model's by the pose, {DEPTH_ERROR_MM:.0f} mm")
    models = _bop_models(folder)
    scenes = sorted(path.parent for path in folder.glob("*/*/scene_gt.json"))
    cameras = {
        scene: read_record(scene / "scene_camera.json", BopCameras, "cameras of BOP").root
        for scene in scenes
    }
    for scene, frame, number, entry, alone in _bop_entries(scenes):
        R, t_mm = np.reshape(entry.cam_R_m2c, (3, 3)), np.array(entry.cam_t_m2c)
        poses.checked += 1
        if not np.allclose(R @ R.T, np.eye(3), atol=ROUNDED_NUMBER_ERROR) or np.linalg.det(R) < 0:
            poses.faults.append(Fault(frame, "cam_R_m2c is no rotation"))
            continue
        path = scene / "mask_visib" / f"{frame:06d}_{number:06d}.png"
        if not path.exists() or entry.obj_id not in models:
            continue
        if frame not in cameras[scene]:
            poses.faults.append(Fault(frame, "scene_camera.json has no camera of it"))
            continue
        record = cameras[scene][frame]
        mask, model = read_image(path) > 0, models[entry.obj_id]
        vertices_mm = np.asarray(model.vertices) @ R.T + t_mm
        model_mm = depth_of_mesh(_bop_camera(record, mask), vertices_mm, np.asarray(model.faces))
        masks.checked += 1
        texts = _mask_faults(mask, np.isfinite(model_mm), alone)
        masks.faults += [Fault(frame, text) for text in texts]
        depth_path = scene / "depth" / f"{frame:06d}.png"
        if depth_path.exists():
            depths.checked += 1
            depth_mm = read_image(depth_path) * record.depth_scale
            if depth_mm.shape != mask.shape:
                depths.faults.append(Fault(frame, "the depth is not of the mask's size"))
                continue
            depths.faults += [Fault(frame, text) for text in _depth_faults(depth_mm, model_mm, mask)]
    return [poses, masks, depths]


def _bop_models(folder: Path) -> dict[int, Any]:
    """The meshes by the numbers in their names."""
    models = {}
    for path in sorted((folder / "models").glob("obj_*.ply")):
        if not (number := path.stem.removeprefix("obj_")).isdecimal():
            raise InputError(f"{path}: BOP names its models by numbers, as in obj_000001.ply; rename it")
        try:
            mesh = trimesh.load_mesh(BytesIO(read_bytes(path)), file_type="ply", process=False)
        except InputError:
            raise
        except Exception:  # trimesh raises many kinds of exceptions for broken files
            raise InputError(f"{path}: cannot be read as PLY; export it again") from None
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            raise InputError(f"{path}: has no triangles; export it again")
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if faces.min() < 0 or faces.max() >= len(vertices) or not np.isfinite(vertices).all():
            raise InputError(f"{path}: triangles refer to vertices that do not exist; export it again")
        models[int(number)] = mesh
    return models


def _bop_entries(scenes: list[Path]) -> Iterator[tuple[Path, int, int, BopPose, bool]]:
    """Scene, image id, number in the image, pose, and whether it is alone in the image."""
    for scene in scenes:
        poses = read_record(scene / "scene_gt.json", BopPoses, "poses of BOP").root
        for frame, entries in poses.items():
            for number, entry in enumerate(entries):
                yield scene, frame, number, entry, len(entries) == 1


def _bop_camera(record: BopCamera, mask: BoolArray) -> Camera:
    K = np.reshape(record.cam_K, (3, 3))
    height, width = mask.shape
    fx, fy, cx, cy = (float(x) for x in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    return Camera(width, height, fx, fy, cx, cy, sensor_width_m=1.0)


def _mask_faults(mask: BoolArray, model: BoolArray, alone: bool) -> Iterator[str]:
    """Where other objects may stand before this one, its mask may be less than its model."""
    pairs = (("mask", mask, "model", model), ("model", model, "mask", mask))[: 2 if alone else 1]
    for one, ours, other, theirs in pairs:
        off = int((ours & ~theirs).sum())
        if off > MASK_PX + (1 - MASK_SHARE) * ours.sum():
            yield f"{off} of the {one}'s {int(ours.sum())} pixels are not on the {other}"


def _depth_faults(depth_mm: FloatArray, model_mm: FloatArray, mask: BoolArray) -> Iterator[str]:
    both = mask & (depth_mm > 0) & np.isfinite(model_mm)
    if both.any():
        off_mm = float(np.median(np.abs(depth_mm - model_mm)[both]))
        if off_mm > DEPTH_ERROR_MM:
            yield f"depth is {off_mm:.0f} mm from the model in half of the pixels"


def _yolo(folder: Path) -> list[Result]:
    data = YoloData.read(folder / "data.yaml")
    root, (count, each) = folder / data.path, data.kpt_shape
    classes = set(data.names if isinstance(data.names, dict) else range(len(data.names)))
    named = {"train": data.train, "val": data.val, "test": data.test}
    lists = {part: _yolo_images(root, where) for part, where in named.items() if where}
    number_of = {image: i for i, image in enumerate(sorted(set().union(*lists.values())))}
    files = Result("files", "every image is there, and has a text", len(number_of))
    rows = Result("rows", "rows are of a known class, as long as kpt_shape asks")
    boxes = Result("boxes", "boxes lie in the image")
    points = Result("keypoints", "labelled keypoints lie in the image")
    parts = Result("partition", "no image is in two parts", sum(map(len, lists.values())))
    for image, number in number_of.items():
        text = _yolo_text(image)
        if not image.is_file() or not text.is_file():
            files.faults.append(Fault(number, f"{(text if image.is_file() else image).name}: missing"))
            continue
        for row in read_text(text).splitlines():
            numbers = _numbers(row)
            rows.checked += 1
            if len(numbers) != 5 + count * each or numbers[0] not in classes:
                rows.faults.append(Fault(number, f"{text.name}: {len(numbers)} numbers, or its class"))
                continue
            boxes.checked += 1
            boxes.faults += [Fault(number, f"{text.name}: {x}") for x in _yolo_box_faults(numbers[1:5])]
            points.checked += 1
            texts = _yolo_point_faults(np.reshape(numbers[5:], (count, each)))
            points.faults += [Fault(number, f"{text.name}: {x}") for x in texts]
    for image in _yolo_shared(lists):
        parts.faults.append(Fault(number_of[image], f"{image.name}: is in two parts"))
    return [files, rows, boxes, points, parts]


def _yolo_images(root: Path, entry: str) -> set[Path]:
    """Images of a part: a folder's, or those that a text file lists from its own folder."""
    if (root / entry).is_dir():
        return {path for path in (root / entry).rglob("*") if path.suffix.lower() in _IMAGES}
    names = read_text(root / entry).split("\n")
    return {(root / entry).parent / name.strip() for name in names if name.strip()}


def _numbers(row: str) -> FloatArray:
    """The numbers of a row, or none where one is no number."""
    try:
        numbers = np.array(row.split(), dtype=np.float64)
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def _yolo_text(image: Path) -> Path:
    """Labels lie where the last folder ``images`` of the path is called ``labels``."""
    before, _, after = str(image.with_suffix(".txt")).rpartition("/images/")
    return Path(f"{before}/labels/{after}")


def _yolo_box_faults(box: FloatArray) -> Iterator[str]:
    """(4,) centre and size, as shares of the image."""
    if box[2:].min() <= 0 or np.any(np.abs(box[:2] - 0.5) + box[2:] / 2 > 0.5 + ROUNDED_NUMBER_ERROR):
        yield "the box leaves the image, or has no area"


def _yolo_point_faults(points: FloatArray) -> Iterator[str]:
    """(K, 2) or (K, 3) points as shares of the image, and visibilities; (0, 0) is no point."""
    labelled = points[:, 2] != NOT_IN_FRAME if points.shape[1] == 3 else points.any(axis=1)
    if np.any(np.abs(points[labelled, :2] - 0.5) > 0.5 + ROUNDED_NUMBER_ERROR):
        yield "a labelled keypoint is outside the image"
    if points.shape[1] == 3 and not np.isin(points[:, 2], range(VISIBLE + 1)).all():
        yield "a visibility is none of 0, 1, 2"


def _yolo_shared(lists: dict[str, set[Path]]) -> set[Path]:
    """In two parts; a dataset that is not divided names all its images in each."""
    parts = list(lists.values())
    if all(part == parts[0] for part in parts):
        return set()
    return set().union(*(a & b for i, a in enumerate(parts) for b in parts[:i]))
