"""How right detections are: COCO's averages by COCO's tool, box overlap, SPEED's scores.

COCO's metrics are those of its own evaluation code, which faster-coco-eval repeats to the digit.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from posse_core.errors import ComponentError
from posse_core.frames import matrix_from_quaternion
from posse_core.interfaces.detector import Detection
from posse_core.model.arrays import FloatArray

SpeedVersion = Literal["2019", "2021", "2023"]
_T_FLOOR = 0.002173  # of SPEED+'s calibration: what the testbed's own truth is worth
_Q_FLOOR_RAD = np.deg2rad(0.169)


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


def overlap_metrics(
    truths: Sequence[Sequence[Truth]], detections: Sequence[Sequence[Detection]]
) -> dict[str, float]:
    """Mean and median overlap of each craft with the best detection of its class, 0 if there is none."""
    overlaps = [
        next((float(box_iou(d.box_px, truth.box_px)) for d in found if d.label == truth.label), 0.0)
        for image, found in zip(truths, detections, strict=True)
        for truth in image
    ]
    if not overlaps:
        return {}
    return {"box IoU mean": float(np.mean(overlaps)), "box IoU median": float(np.median(overlaps))}


def pose_errors(
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    R_found: FloatArray,
    t_found_m: FloatArray,
    symmetries: Sequence[FloatArray] = (),
) -> tuple[float, float]:
    """SPEED's errors of one pose.

    Args:
        R_cam_from_body, t_body_cam_m: (3, 3) and (3,), the truth.
        R_found, t_found_m: the estimate.
        symmetries: (3, 3) turns of the body that leave its looks; the nearest counts.

    Returns:
        e_t = |t − t_found| / |t|, and e_q in radians, the angle between the attitudes.
    """
    t = np.asarray(t_body_cam_m, np.float64)
    e_t = float(np.linalg.norm(t - t_found_m) / np.linalg.norm(t))
    turns = [np.eye(3), *symmetries]
    return e_t, min(_angle(R_cam_from_body @ S, R_found) for S in turns)


def _angle(R_a: FloatArray, R_b: FloatArray) -> float:
    R = np.asarray(R_a).T @ np.asarray(R_b)
    sine = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(sine, np.trace(R) - 1))


def quaternion_pose_errors(
    q: FloatArray, t_m: FloatArray, q_found: FloatArray, t_found_m: FloatArray
) -> tuple[float, float]:
    """:func:`pose_errors` of scalar-first quaternions."""
    return pose_errors(matrix_from_quaternion(q), t_m, matrix_from_quaternion(q_found), t_found_m)


def speed_score(e_t: FloatArray, e_q_rad: FloatArray, version: SpeedVersion) -> float:
    """The score of poses; lower is better.

    ``2019``: mean of e_t + e_q (Kisantal et al. 2020). ``2021``: SPEED+, where a pose better than the
    calibration in both counts as exact. ``2023``: SPEED+ since, where each error better than the
    calibration counts as none by itself (Park et al. 2023).

    Args:
        e_t: (N,) relative error of the place.
        e_q_rad: (N,) error of the attitude.
    """
    e_t, e_q = np.asarray(e_t, np.float64), np.asarray(e_q_rad, np.float64)
    fine_t, fine_q = e_t < _T_FLOOR, e_q < _Q_FLOOR_RAD
    if version == "2021":
        fine_t = fine_q = fine_t & fine_q
    if version != "2019":
        e_t, e_q = np.where(fine_t, 0.0, e_t), np.where(fine_q, 0.0, e_q)
    return float(np.mean(e_t + e_q))


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
