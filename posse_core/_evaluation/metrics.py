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
from posse_core._errors import ComponentError
from posse_core._interfaces.detector import Detection


@dataclass(frozen=True)
class Truth:
    """What an image shows: the class and the visible box, x, y, width, height."""

    label: str
    box_px: FloatArray


def box_iou(a_px: FloatArray, b_px: FloatArray) -> FloatArray:
    """Intersection over union of boxes (..., 4) x, y, width, height, pair by pair."""
    a, b = np.asarray(a_px, np.float64), np.asarray(b_px, np.float64)
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    common = np.clip(high - low, 0, None).prod(axis=-1)
    union = a[..., 2:].prod(axis=-1) + b[..., 2:].prod(axis=-1) - common
    return np.asarray(common / np.maximum(union, 1e-12))


def coco_metrics(
    truths: Sequence[Sequence[Truth]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
) -> dict[str, float]:
    """COCO's averages over images: mAP, mAP50, mAP75, mAR (100 detections), and ``AP.CLASS`` of each.

    A class that no image shows has no AP.

    Args:
        truths, detections: by image.

    Raises:
        ComponentError: neither faster-coco-eval nor its equal is installed.
    """
    evaluation = _coco(truths, detections, classes, max_detections=(1, 10, 100))
    precision = evaluation.eval["precision"]  # (IoU, recall, class, area, detections)
    metrics = {
        "mAP": _mean(precision[:, :, :, 0, -1]),
        "mAP50": _mean(precision[0, :, :, 0, -1]),
        "mAP75": _mean(precision[5, :, :, 0, -1]),
        "mAR": _mean(evaluation.eval["recall"][:, :, 0, -1]),
    }
    shown = {truth.label for image in truths for truth in image}
    for place, name in enumerate(classes):
        if name in shown:
            metrics[f"AP.{name}"] = _mean(precision[:, :, place, 0, -1])
    return metrics


def proposal_recall(
    boxes: Sequence[Sequence[FloatArray]],
    scores: Sequence[Sequence[float]],
    truths: Sequence[Sequence[Truth]],
) -> dict[str, float]:
    """AR100 and AR1k at IoU 0.5 of proposals whatever their class: the thesis' Table 5.2."""
    found = [
        [Detection("any", score, box) for score, box in zip(s, b, strict=True)]
        for s, b in zip(scores, boxes, strict=True)
    ]
    wanted = [[Truth("any", truth.box_px) for truth in image] for image in truths]
    evaluation = _coco(wanted, found, ("any",), max_detections=(1, 100, 1000))
    recall = evaluation.eval["recall"]  # (IoU, class, area, detections)
    return {"AR100": _mean(recall[0, :, 0, 1]), "AR1k": _mean(recall[0, :, 0, 2])}


def best_overlaps(truths: Sequence[Truth], detections: Sequence[Detection]) -> list[float]:
    """Overlap of each craft of an image with the best detection of its class, 0 if there is none.

    Args:
        detections: best first.
    """
    return [
        next((float(box_iou(d.box_px, truth.box_px)) for d in detections if d.label == truth.label), 0.0)
        for truth in truths
    ]


def precision_by_recall(
    truths: Sequence[Sequence[Truth]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
) -> dict[str, dict[float, FloatArray]]:
    """COCO's curves: class → overlap (0.5, 0.75, 0.9) → (101,) precision at a recall of 0, 0.01, … 1.

    A class that no image shows has no curve.
    """
    precision = _coco(truths, detections, classes, max_detections=(1, 10, 100)).eval["precision"]
    shown = {truth.label for image in truths for truth in image}
    return {
        name: {iou: precision[row, :, place, 0, -1] for iou, row in ((0.5, 0), (0.75, 5), (0.9, 8))}
        for place, name in enumerate(classes)
        if name in shown
    }


def _mean(values: FloatArray) -> float:
    """COCO's mean: −1 marks what no truth speaks of."""
    known = values[values > -1]
    return float(known.mean()) if known.size else 0.0


def _coco(
    truths: Sequence[Sequence[Truth]],
    detections: Sequence[Sequence[Detection]],
    classes: Sequence[str],
    max_detections: Sequence[int],
) -> Any:
    try:
        from faster_coco_eval import COCO, COCOeval_faster
    except ImportError as error:
        raise ComponentError(
            f"COCO's metrics need faster-coco-eval ({error}): pip install faster-coco-eval"
        ) from None
    number = {name: place for place, name in enumerate(classes, 1)}
    annotations: list[Mapping[str, object]] = []
    results: list[Mapping[str, object]] = []
    for image, (wanted, found) in enumerate(zip(truths, detections, strict=True)):
        for truth in wanted:
            box = [float(v) for v in truth.box_px]
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": image,
                    "category_id": number[truth.label],
                    "bbox": box,
                    "area": box[2] * box[3],
                    "iscrowd": 0,
                }
            )
        results += [
            {
                "image_id": image,
                "category_id": number[d.label],
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
            "categories": [{"id": place, "name": name} for name, place in number.items()],
        }
        coco.createIndex()
        found_coco = coco.loadRes(results)
        evaluation = COCOeval_faster(coco, found_coco, "bbox")
        evaluation.params.maxDets = list(max_detections)
        evaluation.evaluate()
        evaluation.accumulate()
    return evaluation
