"""Measure a detector, and pose from its keypoints, on one part of a dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from posse_core.dataset import Dataset
from posse_core.detection.pnp import solve_pose
from posse_core.errors import InputError
from posse_core.evaluation.metrics import (
    Truth,
    coco_metrics,
    overlap_metrics,
    pose_errors,
    speed_score,
)
from posse_core.frames import matrix_from_quaternion
from posse_core.interfaces.detector import Detection, Detector, KeypointFinder
from posse_core.model.arrays import FloatArray

_PHASES_DEG = (0, 30, 60, 90, 120, 180)


@dataclass(frozen=True)
class Group:
    """Metrics of the frames that have something in common."""

    name: str
    frames: int
    metrics: Mapping[str, float]


def frames_of(dataset: Dataset, part: str) -> list[int]:
    """Indices of the frames of a part; all of them where the dataset was not divided and ``part`` is
    ``all``.

    Raises:
        InputError: no such part, or it is empty.
    """
    indices = [int(i) for i in dataset.frames.indices] if part == "all" else dataset.part(part)
    if not indices:
        raise InputError(f"{dataset.folder}: part {part!r} has no frames")
    return indices


def truths_of(labels: Mapping[str, Any]) -> list[Truth]:
    """What a label line says is seen.

    Raises:
        InputError: it has no boxes.
    """
    if "box_visible_px" not in labels:
        raise InputError("the labels have no boxes; make the dataset with the annotator 'box'")
    box = labels["box_visible_px"]
    return [] if box is None else [Truth(labels["spacecraft"], np.array(box, np.float64))]


def evaluate(
    dataset: Dataset,
    indices: Sequence[int],
    detector: Detector,
    finder: KeypointFinder | None = None,
) -> list[Group]:
    """Metrics of all frames, then by class, range (quarters) and phase angle.

    With a finder, poses too, each from the best detection where its class is right: the share of shown
    craft that got one, medians of e_t and e_q, and SPEED's scores over those.

    Raises:
        InputError: the labels lack what is measured.
    """
    for model in (detector, finder):
        missing = sorted(set(dataset.spacecraft_by_name) - set(model.classes)) if model else []
        if model and missing:
            raise InputError(
                f"the model does not know {', '.join(missing)}, which {dataset.folder} shows; it knows"
                f" {', '.join(model.classes)}"
            )
    lines = [dataset.frame(index) for index in indices]
    classes = sorted(dataset.spacecraft_by_name)
    truths = [truths_of(line) for line in lines]
    detections: list[list[Detection]] = []
    errors: list[tuple[float, float] | None] = []
    for index, line in zip(indices, lines, strict=True):
        image = dataset.image(index)
        found = [d for d in detector.predict([image])[0] if d.label in classes]
        detections.append(found)
        if finder is not None:
            errors.append(_pose(dataset, line, finder, image, found[:1]))
    groups = []
    for name, members in _groups(lines):
        chosen = [truths[i] for i in members], [detections[i] for i in members]
        metrics = {**coco_metrics(*chosen, classes), **overlap_metrics(*chosen)}
        if finder is not None:
            shown = [i for i in members if truths[i]]
            metrics |= _pose_metrics([e for i in shown if (e := errors[i]) is not None], len(shown))
        groups.append(Group(name, len(members), metrics))
    return groups


def _pose(
    dataset: Dataset,
    line: Mapping[str, Any],
    finder: KeypointFinder,
    image: FloatArray,
    best: Sequence[Detection],
) -> tuple[float, float] | None:
    if not best or best[0].label != line["spacecraft"]:
        return None
    (found,) = finder.find(image, best)
    assert found.keypoints_px is not None
    assert found.keypoints_sigma_px is not None
    points = finder.keypoints_body_m[found.label]
    pose = solve_pose(points, found.keypoints_px, found.keypoints_sigma_px, dataset.camera)
    if pose is None:
        return None
    if "q_cam_from_body" not in line:
        raise InputError(
            f"{dataset.folder}: the labels have no poses; make the dataset with the annotator 'pose'"
        )
    return pose_errors(
        matrix_from_quaternion(np.array(line["q_cam_from_body"])),
        np.array(line["t_body_cam_m"]),
        pose.R_cam_from_body,
        pose.t_body_cam_m,
        dataset.spacecraft_by_name[found.label].symmetries,
    )


def _pose_metrics(errors: Sequence[tuple[float, float]], shown: int) -> dict[str, float]:
    if not shown:
        return {}
    found = {"poses found": len(errors) / shown}
    if not errors:
        return found
    e_t, e_q = np.array(errors).T
    return {
        **found,
        "e_t median": float(np.median(e_t)),
        "e_q median, deg": float(np.rad2deg(np.median(e_q))),
        "SPEED 2019": speed_score(e_t, e_q, "2019"),
        "SPEED 2021": speed_score(e_t, e_q, "2021"),
        "SPEED 2023": speed_score(e_t, e_q, "2023"),
    }


def _groups(lines: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, list[int]]]:
    everything = list(range(len(lines)))
    yield "all", everything
    names = sorted({line["spacecraft"] for line in lines})
    if len(names) > 1:
        for name in names:
            yield name, [i for i in everything if lines[i]["spacecraft"] == name]
    if "range_m" not in lines[0]:
        return
    ranges = np.array([line["range_m"] for line in lines])
    for quarter in np.array_split(np.argsort(ranges, kind="stable"), 4):
        if len(quarter):
            yield f"{ranges[quarter[0]]:.3g}-{ranges[quarter[-1]]:.3g} m", quarter.tolist()
    phases = np.rad2deg([line["phase_angle_rad"] for line in lines])
    for low, high in pairwise(_PHASES_DEG):
        members = np.flatnonzero((phases >= low) & (phases < high))
        if len(members):
            yield f"phase {low}-{high} deg", members.tolist()
