"""Whether the exports beside a dataset say what its label lines say."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.coco import read_coco
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._formats.bop import read_bop
from posse_core._formats.colmap import read_colmap
from posse_core._formats.nerfstudio import read_nerfstudio
from posse_core._formats.speed import read_speed
from posse_core._formats.yolo import read_yolo
from posse_core._model.label_line import LabelLine
from posse_core._model.labels import NOT_IN_FRAME

Entry = tuple[LabelLine, Mapping[str, AnyArray]]
"""What an export says of an image: the labels that it has, and arrays."""

NUMBER_ERROR = 1e-6
"""Of numbers that an export holds otherwise than the label line: shares of the image, millimetres."""


def _bop(dataset: Dataset) -> Iterator[Entry]:
    yield from read_bop(dataset.folder / "bop")


def _colmap(dataset: Dataset) -> Iterator[Entry]:
    yield from read_colmap(dataset.folder / "colmap", dataset.camera)


def _nerfstudio(dataset: Dataset) -> Iterator[Entry]:
    yield from read_nerfstudio(dataset.folder / "nerfstudio", dataset.camera)


def _coco(dataset: Dataset) -> Iterator[Entry]:
    yield from ((labels, {}) for labels in read_coco(dataset.folder / "coco.json"))


def _speed(dataset: Dataset) -> Iterator[Entry]:
    for i, pose in enumerate(read_speed(dataset.folder / "speed.json")):
        values = {"q_cam_from_body": pose.q_cam_from_body, "t_body_cam_m": pose.t_body_cam_m}
        yield LabelLine.model_validate({"index": i, "image": pose.image, **values}), {}


def _yolo(dataset: Dataset) -> Iterator[Entry]:
    yield from ((labels, {}) for labels in read_yolo(dataset.folder / "yolo", dataset.camera))


_READERS: dict[str, tuple[str, Callable[[Dataset], Iterator[Entry]]]] = {
    "bop": ("bop/camera.json", _bop),
    "coco": ("coco.json", _coco),
    "colmap": ("colmap", _colmap),
    "nerfstudio": ("nerfstudio", _nerfstudio),
    "speed": ("speed.json", _speed),
    "yolo": ("yolo/data.yaml", _yolo),
}


def check_exports(dataset: Dataset) -> list[Result]:
    """A result for each export that is there; label lines must be whole (see the check ``lines``)."""
    results = []
    for name, (file, read) in _READERS.items():
        if (dataset.folder / file).exists():
            result = Result(f"{name} export", f"{file.split('/')[0]} says what the label lines say")
            results.append(result)
            try:
                result.faults = list(_faults(dataset, read(dataset), result))
            except InputError as error:
                result.faults.append(Fault(None, str(error)))
            except (KeyError, IndexError, TypeError, ValueError, OSError) as error:
                result.faults.append(Fault(None, f"cannot be read: {type(error).__name__}: {error}"))
    return results


def _faults(dataset: Dataset, entries: Iterator[Entry], result: Result) -> Iterator[Fault]:
    position_of = {labels.image: i for i, labels in enumerate(dataset)}
    left = dict(position_of)
    for got, arrays in entries:
        result.checked += 1
        if got.image not in position_of:
            yield Fault(None, f"{got.image}: no frame has this image")
            continue
        if left.pop(got.image, None) is None:
            yield Fault(None, f"{got.image}: is in it twice")
            continue
        labels = dataset[position_of[got.image]]
        for name, value in got:
            if name in ("index", "image"):
                continue
            ours = getattr(labels, name) if labels.has(name) else None
            if not _same(name, ours, value):
                why = _cause(name, ours, value)
                yield Fault(labels.index, f"{name} is not that of the label line{why}")
        for name in _unlike_arrays(dataset, labels, arrays):
            yield Fault(labels.index, f"{name} is not the dataset's")
    for position in left.values():
        yield Fault(int(dataset.indices[position]), "is not in it")


def _same(name: str, ours: Any, theirs: Any) -> bool:
    if name == "keypoints":
        shown = {k: point for k, point in ours.items() if point.visibility != NOT_IN_FRAME}
        return shown.keys() == theirs.keys() and all(
            np.allclose(shown[k], theirs[k], rtol=0, atol=NUMBER_ERROR) for k in shown
        )
    if name == "q_cam_from_body":  # both signs are one rotation
        return _close(ours, theirs) or _close(ours, [-x for x in theirs])
    if isinstance(ours, tuple) and isinstance(theirs, tuple):
        return _close(ours, theirs)
    return bool(ours == theirs)


def _close(ours: Sequence[float], theirs: Sequence[float]) -> bool:
    return len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=NUMBER_ERROR, atol=NUMBER_ERROR)


def _cause(name: str, ours: Any, theirs: Any) -> str:
    if name == "q_cam_from_body" and ours is not None:
        w, x, y, z = ours
        if _same(name, [x, y, z, w], theirs):
            return ": it is scalar-last"
        if _same(name, [w, -x, -y, -z], theirs):
            return ": it is the inverse"
    return ""


def _unlike_arrays(dataset: Dataset, labels: LabelLine, arrays: Mapping[str, AnyArray]) -> list[str]:
    unlike = []
    if "mask" in arrays and not np.array_equal(arrays["mask"], labels.mask_rle.mask()):
        unlike.append("mask")
    if "depth_m" in arrays:
        depth_m = dataset.depth(dataset.position(labels.index)).astype(np.float64)
        there = np.isfinite(arrays["depth_m"])
        off_m = np.abs(arrays["depth_m"] - depth_m)[there]
        if not np.array_equal(there, np.isfinite(depth_m)) or np.any(
            off_m > 0.51 * arrays["depth_step_m"]
        ):
            unlike.append("depth")
    return unlike
