"""Whether the exports beside a dataset say what its label lines say."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._formats.bop import read_bop
from posse_core._formats.coco import read_coco
from posse_core._formats.rle import decode_rle
from posse_core._formats.speed import read_speed
from posse_core._formats.yolo import read_yolo
from posse_core._model.labels import NOT_IN_FRAME

Entry = tuple[str, Mapping[str, Any], Mapping[str, AnyArray]]

NUMBER_ERROR = 1e-6
"""Of numbers that an export holds otherwise than the label line: shares of the image, millimetres."""


def _bop(dataset: Dataset) -> Iterator[Entry]:
    yield from read_bop(dataset.folder / "bop")


def _coco(dataset: Dataset) -> Iterator[Entry]:
    yield from ((name, labels, {}) for name, labels in read_coco(dataset.folder / "coco.json"))


def _speed(dataset: Dataset) -> Iterator[Entry]:
    yield from ((name, labels, {}) for name, labels in read_speed(dataset.folder / "speed.json"))


def _yolo(dataset: Dataset) -> Iterator[Entry]:
    entries = read_yolo(dataset.folder / "yolo", dataset.camera)
    yield from ((name, labels, {}) for name, labels in entries)


_READERS: dict[str, tuple[str, Callable[[Dataset], Iterator[Entry]]]] = {
    "bop": ("bop/camera.json", _bop),
    "coco": ("coco.json", _coco),
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
            except (InputError, KeyError, IndexError, TypeError, ValueError, OSError) as error:
                result.faults.append(Fault(None, f"cannot be read: {type(error).__name__}: {error}"))
    return results


def _faults(dataset: Dataset, entries: Iterator[Entry], result: Result) -> Iterator[Fault]:
    place_of = {labels.get("image"): i for i, labels in enumerate(dataset.label_lines)}
    left = dict(place_of)
    for name, got, arrays in entries:
        result.checked += 1
        if name not in place_of:
            yield Fault(None, f"{name}: no frame has this image")
            continue
        if left.pop(name, None) is None:
            yield Fault(None, f"{name}: is in it twice")
            continue
        labels = dataset.label_lines[place_of[name]]
        for key, value in got.items():
            if not _same(key, labels.get(key), value):
                yield Fault(
                    labels["index"], f"{key} is not that of the label line{_cause(labels, key, value)}"
                )
        for key in _unlike_arrays(dataset, labels, arrays):
            yield Fault(labels["index"], f"{key} is not the dataset's")
    for place in left.values():
        yield Fault(int(dataset.label_lines.indices[place]), "is not in it")


def _same(key: str, ours: Any, theirs: Any) -> bool:
    if key == "keypoints":
        shown = {name: point for name, point in ours.items() if point[2] != NOT_IN_FRAME}
        return shown.keys() == theirs.keys() and all(
            np.allclose(shown[name], theirs[name], rtol=0, atol=NUMBER_ERROR) for name in shown
        )
    if key == "q_cam_from_body":  # both signs are one rotation
        return _close(ours, theirs) or _close(ours, [-x for x in theirs])
    if isinstance(ours, list) and isinstance(theirs, list):
        return _close(ours, theirs)
    return bool(ours == theirs)


def _close(ours: list[float], theirs: list[float]) -> bool:
    return len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=NUMBER_ERROR, atol=NUMBER_ERROR)


def _cause(labels: Mapping[str, Any], key: str, value: Any) -> str:
    if key == "q_cam_from_body":
        w, x, y, z = labels[key]
        if _same(key, [x, y, z, w], value):
            return ": it is scalar-last"
        if _same(key, [w, -x, -y, -z], value):
            return ": it is the inverse"
    return ""


def _unlike_arrays(
    dataset: Dataset, labels: Mapping[str, Any], arrays: Mapping[str, AnyArray]
) -> list[str]:
    unlike = []
    if "mask" in arrays and not np.array_equal(arrays["mask"], decode_rle(labels["mask_rle"])):
        unlike.append("mask")
    if "depth_m" in arrays:
        depth_m = dataset.truth(labels["index"])["depth_m"].astype(np.float64)
        there = np.isfinite(arrays["depth_m"])
        off_m = np.abs(arrays["depth_m"] - depth_m)[there]
        if not np.array_equal(there, np.isfinite(depth_m)) or np.any(
            off_m > 0.51 * arrays["depth_step_m"]
        ):
            unlike.append("depth")
    return unlike
