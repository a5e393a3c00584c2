"""How right detected boxes are: COCO's averages by COCO's tool, and overlap.

COCO's metrics are those of its own evaluation code, which faster-coco-eval repeats to the digit.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.detector import Detection
from posse_core._model.label_line import BodyLabels, LabelLine


@dataclass(frozen=True)
class TrueBox:
    """What an image shows, by its labels.

    Attributes:
        label: the class, such as ``aqua``.
        box_px: (4,) visible box: x, y, width, height, as of :class:`Detection`.
    """

    label: str
    box_px: FloatArray


def seen_bodies(labels: LabelLine) -> dict[str | None, BodyLabels]:
    """Those of :attr:`LabelLine.instances` of which the image shows a pixel.

    Raises:
        InputError: it has no boxes.
    """
    if not labels.has("box_visible_px"):
        raise InputError("the labels have no boxes; make the dataset with the annotator 'box'")
    return {k: body for k, body in labels.instances.items() if body.box_visible_px is not None}


def true_box(body: BodyLabels) -> TrueBox:
    """The box of one of :func:`seen_bodies`."""
    return TrueBox(body.spacecraft, np.array(body.box_visible_px, np.float64))


def true_boxes(labels: LabelLine) -> list[TrueBox]:
    """What a frame shows, by its labels: a box for each body of which the image shows a pixel, the
    target's first.

    Raises:
        InputError: it has no boxes.
    """
    return [true_box(body) for body in seen_bodies(labels).values()]


def box_iou(a_px: FloatArray, b_px: FloatArray) -> FloatArray:
    """Intersection over union of boxes (..., 4) x, y, width, height, pair by pair."""
    a, b, common = _common(a_px, b_px)
    union = a[..., 2:].prod(axis=-1) + b[..., 2:].prod(axis=-1) - common
    return np.asarray(common / np.maximum(union, 1e-12))


def box_share(a_px: FloatArray, b_px: FloatArray) -> FloatArray:
    """Share of the area of boxes (..., 4) x, y, width, height that lies in others, pair by pair."""
    a, _, common = _common(a_px, b_px)
    return np.asarray(common / np.maximum(a[..., 2:].prod(axis=-1), 1e-12))


def _common(a_px: FloatArray, b_px: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Boxes as arrays, and the area (...) that each pair has in common."""
    a, b = np.asarray(a_px, np.float64), np.asarray(b_px, np.float64)
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    return a, b, np.clip(high - low, 0, None).prod(axis=-1)


def coco_metrics(
    truths: Sequence[Sequence[TrueBox]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
) -> dict[str, float]:
    """COCO's averages over images, each 0 … 1, by COCO's own code.

    Args:
        truths, detections: those of each image.
        classes: names; detections of others are an error.

    Returns:
        ``mAP`` over overlaps of 0.5 to 0.95, ``mAP50``, ``mAP75``, ``mAR`` (100 detections an image),
        ``AR50``, its greatest term, at an overlap of 0.5, which the thesis calls mAR (section 2.5.3),
        and ``AP.CLASS`` of each class that an image shows.

    Raises:
        ComponentError: neither faster-coco-eval nor its equal is installed.
    """
    evaluation = _coco(truths, detections, classes)
    precision = evaluation.eval["precision"]  # (IoU, recall, class, area, detections)
    metrics = {
        "mAP": _mean(precision[:, :, :, 0, -1]),
        "mAP50": _mean(precision[0, :, :, 0, -1]),
        "mAP75": _mean(precision[5, :, :, 0, -1]),
        "mAR": _mean(evaluation.eval["recall"][:, :, 0, -1]),
        "AR50": _mean(evaluation.eval["recall"][0, :, 0, -1]),
    }
    shown = {truth.label for image in truths for truth in image}
    for column, name in enumerate(classes):
        if name in shown:
            metrics[f"AP.{name}"] = _mean(precision[:, :, column, 0, -1])
    return metrics


def matches(truths: Sequence[TrueBox], detections: Sequence[Detection]) -> list[int | None]:
    """Which detection each craft of an image is judged by: the best of its class, None without one.

    Where the image shows several craft of a class, a detection belongs to the one that it overlaps most
    or, if it overlaps none, to the one whose centre is nearest.

    Args:
        truths: of the image.
        detections: best first.

    Returns:
        For each truth, an index into ``detections``.
    """
    found: list[int | None] = [None] * len(truths)
    for place, detection in enumerate(detections):
        alike = [i for i, truth in enumerate(truths) if truth.label == detection.label]
        if not alike:
            continue
        boxes_px = np.stack([truths[i].box_px for i in alike])
        overlap = box_iou(boxes_px, detection.box_px)
        away_px = np.linalg.norm(_centre(boxes_px) - _centre(detection.box_px), axis=1)
        mine = alike[int(np.lexsort((away_px, -overlap))[0])]
        if found[mine] is None:
            found[mine] = place
    return found


def _centre(box_px: FloatArray) -> FloatArray:
    return np.asarray(box_px[..., :2] + box_px[..., 2:] / 2)


def precision_by_recall(
    truths: Sequence[Sequence[TrueBox]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
) -> dict[str, dict[float, FloatArray]]:
    """COCO's curves: class → overlap (0.5, 0.55, … 0.95) → (101,) precision at a recall of 0, 0.01, … 1.

    A class that no image shows has no curve.
    """
    precision = _coco(truths, detections, classes).eval["precision"]
    shown = {truth.label for image in truths for truth in image}
    return {
        name: {0.5 + 0.05 * row: precision[row, :, column, 0, -1] for row in range(len(precision))}
        for column, name in enumerate(classes)
        if name in shown
    }


def _mean(values: FloatArray) -> float:
    """COCO's mean: −1 marks what no truth speaks of."""
    known = values[values > -1]
    return float(known.mean()) if known.size else 0.0


def _coco(
    truths: Sequence[Sequence[TrueBox]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
) -> Any:
    try:
        from faster_coco_eval import COCO, COCOeval_faster
    except ImportError as error:
        raise ComponentError(
            f"COCO's metrics need faster-coco-eval ({error}): pip install faster-coco-eval"
        ) from None
    number_of = {name: number for number, name in enumerate(classes, 1)}
    annotations: list[Mapping[str, object]] = []
    results: list[Mapping[str, object]] = []
    for image, (wanted, found) in enumerate(zip(truths, detections, strict=True)):
        for truth in wanted:
            box = [float(v) for v in truth.box_px]
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": image,
                    "category_id": number_of[truth.label],
                    "bbox": box,
                    "area": box[2] * box[3],
                    "iscrowd": 0,
                }
            )
        results += [
            {
                "image_id": image,
                "category_id": number_of[d.label],
                "bbox": [float(v) for v in d.box_px],
                "score": float(d.score),
            }
            for d in found
        ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {
            "images": [{"id": image} for image in range(len(truths))],
            "annotations": annotations,
            "categories": [{"id": number, "name": name} for name, number in number_of.items()],
        }
        coco.createIndex()
        found_coco = coco.loadRes(results)
        evaluation = COCOeval_faster(coco, found_coco, "bbox")
        evaluation.params.maxDets = [1, 10, 100]
        evaluation.evaluate()
        evaluation.accumulate()
    return evaluation
