"""The accuracy of a model file in a few figures, by which two files can be compared."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from posse_core._dataset.images import LabelledImages
from posse_core._detection.evaluate import evaluate
from posse_core._detection.models import open_detector, open_keypoint_finder
from posse_core._errors import InputError
from posse_core._evaluation.metrics import coco_metrics, seen_bodies, true_box
from posse_core._interfaces.detector import Detection, KeypointFinder
from posse_core._plugins.registry import Registry


def accuracy(
    dataset: LabelledImages, positions: Iterable[int], path: Path, task: str, registry: Registry
) -> dict[str, float]:
    """Return mAP, mAP50 and mean IoU of a detector, or the median error of a keypoint finder, px.

    Raises:
        InputError: The labels lack what is measured.
    """
    if task == "keypoints":
        return _of_keypoints(dataset, positions, open_keypoint_finder(path, registry, {}))
    judged = evaluate(dataset, positions, open_detector(path, registry, {}))
    metrics = coco_metrics(
        [j.truths for j in judged], [j.detections for j in judged], sorted(dataset.classes)
    )
    overlap = float(np.mean([body.overlap for j in judged for body in j.bodies]))
    return {"mAP": metrics["mAP"], "mAP50": metrics["mAP50"], "box IoU mean": overlap}


def _of_keypoints(
    dataset: LabelledImages, positions: Iterable[int], finder: KeypointFinder
) -> dict[str, float]:
    """Measure a keypoint finder in the labelled boxes."""
    away_px: list[float] = []
    for i in positions:
        labels = dataset[i]
        if not labels.has("keypoints"):
            raise InputError(
                f"{dataset.folder}: the labels have no keypoints; make the dataset with the annotator"
                " 'keypoints'"
            )
        for body in seen_bodies(labels).values():
            if body.spacecraft not in finder.classes or not body.keypoints:
                continue
            box = Detection(body.spacecraft, 1.0, true_box(body).box_px)
            known = np.array([point[:2] for point in body.keypoints.values()], np.float64)
            (found,) = finder.find(dataset.image(i), [box])
            distance = np.linalg.norm(np.asarray(found.keypoints_px) - known, axis=1)
            away_px += distance[np.isfinite(distance)].tolist()
    return {"median keypoint error, px": float(np.median(away_px))}
