"""Whether the exports beside a dataset say what its label lines say."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.coco import read_coco
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.result import Fault, Result
from posse_core._formats.bop import labels_of_object, read_bop
from posse_core._formats.colmap import read_colmap
from posse_core._formats.exported import ExportedBody, ExportedImage
from posse_core._formats.nerfstudio import read_nerfstudio
from posse_core._formats.rigid_objects import RigidObjects
from posse_core._formats.speed import read_speed
from posse_core._formats.yolo import read_yolo
from posse_core._model.label_line import BodyLabels, LabelLine
from posse_core._model.labels import NOT_IN_FRAME

NUMBER_ERROR = 1e-6
"""Of numbers that an export holds otherwise than the label line: shares of the image, millimetres."""

Wanted = Callable[[LabelLine], list[tuple[str, ExportedBody]]]
"""What an export should say of a frame: for each body in order, words for it, and its labels. Without a
mask, that of the labels holds."""


class _Export(NamedTuple):
    """How an export is read, and what it should hold.

    Attributes:
        file: that it has.
        read: what it says of each image.
        wanted: what it should say.
    """

    file: str
    read: Callable[[Dataset], Iterator[ExportedImage]]
    wanted: Callable[[Dataset], Wanted]


def _coco(dataset: Dataset) -> Iterator[ExportedImage]:
    for labels in read_coco(dataset.folder / "coco.json"):
        yield ExportedImage(labels.image, [body for _, body in _seen(labels)], is_named=True)


def _speed(dataset: Dataset) -> Iterator[ExportedImage]:
    for pose in read_speed(dataset.folder / "speed.json"):
        values = {"q_cam_from_body": pose.q_cam_from_body, "t_body_cam_m": pose.t_body_cam_m}
        yield ExportedImage(pose.image, [ExportedBody(BodyLabels.model_validate(values))])


def _target(labels: LabelLine) -> list[tuple[str, ExportedBody]]:
    """Formats of one spacecraft hold the target alone."""
    return [("", ExportedBody(labels))]


def _seen(labels: LabelLine) -> list[tuple[str, ExportedBody]]:
    return [
        ("" if name is None else f"{name}: ", ExportedBody(body, name=name))
        for name, body in labels.instances.items()
        if body.box_visible_px is not None
    ]


def _objects(dataset: Dataset) -> Wanted:
    objects = RigidObjects(dataset)

    def wanted(labels: LabelLine) -> list[tuple[str, ExportedBody]]:
        return [
            (f"object {number}: " if number else "", ExportedBody(labels_of_object(each), each.mask))
            for number, each in enumerate(objects.in_frame(labels))
        ]

    return wanted


_EXPORTS: dict[str, _Export] = {
    "bop": _Export("bop/camera.json", lambda d: read_bop(d.folder / "bop"), _objects),
    "coco": _Export("coco.json", _coco, lambda _: _seen),
    "colmap": _Export("colmap", lambda d: read_colmap(d.folder / "colmap", d.camera), lambda _: _target),
    "nerfstudio": _Export(
        "nerfstudio", lambda d: read_nerfstudio(d.folder / "nerfstudio", d.camera), lambda _: _target
    ),
    "speed": _Export("speed.json", _speed, lambda _: _target),
    "yolo": _Export("yolo/data.yaml", lambda d: read_yolo(d.folder / "yolo", d.camera), lambda _: _seen),
}


def check_exports(dataset: Dataset) -> list[Result]:
    """A result for each export that is there; label lines must be whole (see the check ``lines``)."""
    results = []
    for name, export in _EXPORTS.items():
        if (dataset.folder / export.file).exists():
            what = f"{export.file.split('/')[0]} says what the label lines say"
            result = Result(f"{name} export", what)
            results.append(result)
            try:
                result.faults = list(_faults(dataset, export, result))
            except InputError as error:
                result.faults.append(Fault(None, str(error)))
            except (KeyError, IndexError, TypeError, ValueError, OSError) as error:
                result.faults.append(Fault(None, f"cannot be read: {type(error).__name__}: {error}"))
    return results


def _faults(dataset: Dataset, export: _Export, result: Result) -> Iterator[Fault]:
    position_of = {labels.image: i for i, labels in enumerate(dataset)}
    left, wanted = dict(position_of), export.wanted(dataset)
    for got in export.read(dataset):
        result.checked += 1
        if got.image not in position_of:
            yield Fault(None, f"{got.image}: no frame has this image")
            continue
        if left.pop(got.image, None) is None:
            yield Fault(None, f"{got.image}: is in it twice")
            continue
        labels = dataset[position_of[got.image]]
        for text in _unlike(wanted(labels), got):
            yield Fault(labels.index, text)
        if got.depth_m is not None and not _is_depth(dataset, labels, got.depth_m, got.depth_step_m):
            yield Fault(labels.index, "depth is not the dataset's")
    for position in left.values():
        yield Fault(int(dataset.indices[position]), "is not in it")


def _unlike(wanted: Sequence[tuple[str, ExportedBody]], got: ExportedImage) -> Iterator[str]:
    if len(wanted) != len(got.bodies):
        yield f"it has {len(got.bodies)} bodies of this image, the label line has {len(wanted)}"
        return
    for (who, ours), theirs in zip(wanted, got.bodies, strict=True):
        if got.is_named and ours.name != theirs.name:
            yield f"it has a body {theirs.name!r}, not {ours.name!r}"
        for name, value in theirs.labels:
            if name not in BodyLabels.model_fields:
                continue
            our_value = getattr(ours.labels, name) if ours.labels.has(name) else None
            if not _same(name, our_value, value):
                why = _cause(name, our_value, value)
                yield f"{who}{name} is not that of the label line{why}"
        if theirs.mask is not None:
            mask = ours.labels.mask_rle.mask() if ours.mask is None else ours.mask
            if not np.array_equal(mask, theirs.mask):
                yield f"{who}mask is not the dataset's"


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


def _is_depth(dataset: Dataset, labels: LabelLine, depth_m: FloatArray, step_m: float) -> bool:
    ours_m = dataset.depth(dataset.position(labels.index)).astype(np.float64)
    there = np.isfinite(depth_m)
    off_m = np.abs(depth_m - ours_m)[there]
    return np.array_equal(there, np.isfinite(ours_m)) and not np.any(off_m > 0.51 * step_m)
