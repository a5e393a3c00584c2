"""Labels of another origin, in COCO, SPEED, BOP or YOLO-pose: what can be proven of them by themselves.

A frame's number in a fault is the image's id; where a format has none, its position in the list, from 0
(SPEED), or among all images by name (YOLO). Masks and depths that another program made are allowed to
differ from the model at the outline.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import ValidationError

from posse_core._arrays import BoolArray, FloatArray
from posse_core._dataset.camera import read_camera
from posse_core._dataset.files import read_image, read_json
from posse_core._errors import InputError
from posse_core._evaluation.raster import depth_of_mesh
from posse_core._evaluation.result import Fault, Report, Result
from posse_core._files.reading import parsed_json, read_bytes, read_text
from posse_core._model.camera import Camera
from posse_core._model.label_line import first_fault
from posse_core._model.labels import NOT_IN_FRAME, VISIBLE
from posse_core._model.run_lengths import RunLengths
from posse_core._scenario.yaml_lines import YamlText

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
    prove: Callable[[Path], list[Result]]
    if (path / "models" / "models_info.json").exists():
        prove = _bop
    elif (path / "data.yaml").exists():
        prove = _yolo
    elif path.is_file():
        prove = _json_file
    else:
        return None
    try:
        results = prove(path)
    except (ArithmeticError, AttributeError, LookupError, OSError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: not laid as its format asks: {type(error).__name__}: {error}"
        ) from None
    return Report(path, results[0].checked, tuple(results))


def _json_file(path: Path) -> list[Result]:
    value = parsed_json(read_bytes(path), str(path))
    if isinstance(value, dict) and {"images", "annotations", "categories"} <= value.keys():
        return _coco(path, value)
    if isinstance(value, list) and value and "r_Vo2To_vbs_true" in value[0]:
        return _speed(path, value)
    raise InputError(f"{path}: neither a COCO file nor one of SPEED; name one, or a folder")


def _coco(path: Path, value: dict[str, Any]) -> list[Result]:
    files = Result("files", "every image is there and of its size", len(value["images"]))
    ids = Result("ids", "ids are unique and lead somewhere", len(value["annotations"]))
    boxes = Result("boxes", "boxes lie in the image, and around their mask")
    points = Result("keypoints", "keypoints are of their category, in the image, and counted right")
    images = {image["id"]: image for image in value["images"]}
    categories = {category["id"]: category for category in value["categories"]}
    if len(images) < len(value["images"]):
        ids.faults.append(Fault(None, "two images have one id"))
    for image in value["images"]:
        fault = _image_fault(path.parent / image["file_name"], (image["height"], image["width"]))
        files.faults += [Fault(image["id"], fault)] if fault else []
    seen: set[Any] = set()
    for annotation in value["annotations"]:
        id_, frame = annotation["id"], annotation["image_id"]
        if id_ in seen or id_ == 0:
            ids.faults.append(Fault(frame, f"annotation id {id_} is {'0' if id_ == 0 else 'taken'}"))
        seen.add(id_)
        if frame not in images or annotation["category_id"] not in categories:
            ids.faults.append(Fault(frame, f"annotation {id_} is of no image, or of no category"))
            continue
        boxes.checked += 1
        boxes.faults += [Fault(frame, text) for text in _box_faults(annotation, images[frame])]
        if "keypoints" in annotation:
            points.checked += 1
            category = categories[annotation["category_id"]]
            texts = _keypoint_faults(annotation, images[frame], category)
            points.faults += [Fault(frame, text) for text in texts]
    return [files, ids, boxes, points]


def _image_fault(path: Path, shape: tuple[int, int]) -> str | None:
    try:
        size = read_image(path).shape[:2]
    except InputError as error:
        return str(error)
    return (
        None if size == shape else f"{path.name} is {size[1]} x {size[0]}, not {shape[1]} x {shape[0]}"
    )


def _box_faults(annotation: dict[str, Any], image: dict[str, Any]) -> Iterator[str]:
    x, y, width, height = annotation["bbox"]
    if not (width > 0 and height > 0):
        yield f"the box {annotation['bbox']} has no area"
    elif min(x, y) < -1 or x + width > image["width"] + 1 or y + height > image["height"] + 1:
        yield f"the box {annotation['bbox']} leaves the image"
    rle = annotation.get("segmentation")
    if isinstance(rle, dict) and isinstance(rle["counts"], str):
        try:
            mask = RunLengths(**rle).mask()
        except ValidationError as error:
            yield f"the mask: {first_fault(error)}"
            return
        except ValueError as error:
            yield str(error)
            return
        if np.abs(np.array(_box_of(mask)) - annotation["bbox"]).max() > 1:
            yield f"the box is {annotation['bbox']}, the mask's {_box_of(mask)}"
        if annotation["area"] != mask.sum():
            yield f"the area is {annotation['area']}, the mask's {mask.sum()}"


def _box_of(mask: BoolArray) -> list[int]:
    v, u = np.nonzero(mask)
    return [int(u.min()), int(v.min()), int(np.ptp(u)) + 1, int(np.ptp(v)) + 1] if len(u) else [-1] * 4


def _keypoint_faults(
    annotation: dict[str, Any], image: dict[str, Any], category: dict[str, Any]
) -> Iterator[str]:
    if len(annotation["keypoints"]) != 3 * len(category.get("keypoints", [])):
        yield f"{len(annotation['keypoints'])} numbers are not three a keypoint of {category['name']!r}"
        return
    points = np.reshape(np.array(annotation["keypoints"], dtype=np.float64), (-1, 3))
    labelled = points[:, 2] != NOT_IN_FRAME
    if not np.isin(points[:, 2], range(VISIBLE + 1)).all():
        yield "a visibility is none of 0, 1, 2"
    if annotation["num_keypoints"] != labelled.sum():
        yield f"num_keypoints is {annotation['num_keypoints']}, {labelled.sum()} are labelled"
    uv = points[labelled, :2]
    if np.any(uv < -0.5) or np.any(uv > [image["width"] + 0.5, image["height"] + 0.5]):
        yield "a labelled keypoint is outside the image"


def _speed(path: Path, value: list[dict[str, Any]]) -> list[Result]:
    poses = Result("pose", "unit quaternions, targets before the camera", len(value))
    names = Result("ids", "no image is listed twice", len(value))
    camera_file = path.parent / "camera.json"
    camera = read_camera(camera_file) if camera_file.exists() else None
    aim = Result("aim", "the target's origin is near the image", len(value) if camera else 0)
    seen: set[str] = set()
    for i, entry in enumerate(value):
        q = np.array(entry.get("q_vbs2tango_true", entry.get("q_vbs2tango", [])), dtype=np.float64)
        r_m = np.array(entry["r_Vo2To_vbs_true"], dtype=np.float64)
        if q.shape != (4,) or not abs(np.linalg.norm(q) - 1) < ROUNDED_NUMBER_ERROR:
            poses.faults.append(Fault(i, f"{entry['filename']}: the quaternion is not of length 1"))
        if r_m.shape != (3,) or not r_m[2] > 0:
            poses.faults.append(Fault(i, f"{entry['filename']}: the target is not before the camera"))
        elif camera and not _near(camera, camera.project(r_m)):
            aim.faults.append(Fault(i, f"{entry['filename']}: the target is far outside the image"))
        if entry["filename"] in seen:
            names.faults.append(Fault(i, f"{entry['filename']}: listed twice"))
        seen.add(entry["filename"])
    return [poses, names, aim]


def _near(camera: Camera, uv: FloatArray) -> bool:
    """Within the image and three times as much around it."""
    size = np.array([camera.width_px, camera.height_px])
    return bool(np.all(uv > -3 * size) and np.all(uv < 4 * size))


def _bop(folder: Path) -> list[Result]:
    poses = Result("pose", "rotations are proper, positions finite")
    masks = Result("mask", f"{MASK_SHARE:.0%} of each mask is its model's outline by the pose")
    depths = Result("depth", f"depth is the model's by the pose, {DEPTH_ERROR_MM:.0f} mm")
    models = {
        int(path.stem.split("_")[1]): trimesh.load_mesh(path, process=False)
        for path in sorted((folder / "models").glob("obj_*.ply"))
    }
    scenes = sorted(path.parent for path in folder.glob("*/*/scene_gt.json"))
    cameras = {scene: read_json(scene / "scene_camera.json") for scene in scenes}
    for scene, id_, number, entry, alone in _bop_entries(scenes):
        frame = int(id_)
        R, t_mm = np.reshape(entry["cam_R_m2c"], (3, 3)), np.array(entry["cam_t_m2c"])
        poses.checked += 1
        if not np.allclose(R @ R.T, np.eye(3), atol=ROUNDED_NUMBER_ERROR) or np.linalg.det(R) < 0:
            poses.faults.append(Fault(frame, "cam_R_m2c is no rotation"))
            continue
        path = scene / "mask_visib" / f"{frame:06d}_{number:06d}.png"
        if not path.exists() or entry["obj_id"] not in models:
            continue
        record = cameras[scene][id_]
        mask, model = read_image(path) > 0, models[entry["obj_id"]]
        vertices_mm = np.asarray(model.vertices) @ R.T + t_mm
        model_mm = depth_of_mesh(
            _bop_camera(record["cam_K"], mask), vertices_mm, np.asarray(model.faces)
        )
        masks.checked += 1
        texts = _mask_faults(mask, np.isfinite(model_mm), alone)
        masks.faults += [Fault(frame, text) for text in texts]
        depth_path = scene / "depth" / f"{frame:06d}.png"
        if depth_path.exists():
            depths.checked += 1
            depth_mm = read_image(depth_path) * float(record["depth_scale"])
            depths.faults += [Fault(frame, text) for text in _depth_faults(depth_mm, model_mm, mask)]
    return [poses, masks, depths]


def _bop_entries(scenes: list[Path]) -> Iterator[tuple[Path, str, int, dict[str, Any], bool]]:
    """Scene, image id, number in the image, pose, and whether it is alone in the image."""
    for scene in scenes:
        for id_, entries in read_json(scene / "scene_gt.json").items():
            for number, entry in enumerate(entries):
                yield scene, id_, number, entry, len(entries) == 1


def _bop_camera(cam_K: list[float], mask: BoolArray) -> Camera:
    K = np.reshape(cam_K, (3, 3))
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
    data = YamlText.read(folder / "data.yaml").value
    root, (count, each) = folder / data.get("path", "."), data["kpt_shape"]
    classes = set(data["names"] if isinstance(data["names"], dict) else range(len(data["names"])))
    lists = {part: _yolo_images(root, data[part]) for part in ("train", "val", "test") if data.get(part)}
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
            numbers = np.array(row.split(), dtype=np.float64)
            rows.checked += 1
            if len(numbers) != 5 + count * each or int(numbers[0]) not in classes:
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
