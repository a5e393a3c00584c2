"""Metrics of groups of frames: by class, range, phase angle and background."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.images import LabelledImages
from posse_core._detection.background import BACKGROUNDS, backgrounds
from posse_core._detection.evaluate import Judged
from posse_core._detection.glossary import POSES
from posse_core._evaluation.metrics import coco_metrics
from posse_core._evaluation.poses import speed_score

_PHASES_DEG = (0, 30, 60, 90, 120, 180)
_CORRECT_ADD_DIAMETERS = 0.1
"""A pose is correct if its ADD is below this share of the diameter (Hinterstoisser et al. 2012)."""


@dataclass(frozen=True)
class Group:
    """A group of frames and its metrics."""

    name: str
    frames: int
    metrics: Mapping[str, float]


def groups(dataset: LabelledImages, judged: Sequence[Judged], poses: bool) -> list[Group]:
    """Return the metrics of all frames, then by class, quartile of range, phase angle and background.

    Args:
        dataset: of the frames.
        judged: the evaluated frames.
        poses: whether keypoints were sought. Then the metrics include the share of spacecraft whose pose
            was estimated, and the errors of these poses.
    """
    classes = sorted(dataset.spacecraft_by_name)
    result = []
    for name, members in _members(dataset, judged):
        mine = [judged[i] for i in members]
        metrics = coco_metrics([j.truths for j in mine], [j.detections for j in mine], classes)
        overlaps = [overlap for j in mine for overlap in j.overlaps]
        if overlaps:
            metrics["box IoU mean"] = float(np.mean(overlaps))
            metrics["box IoU median"] = float(np.median(overlaps))
            if poses:
                metrics |= _pose_metrics([j for j in mine if j.truths])
        result.append(Group(name, len(members), metrics))
    return result


def columns(found: Sequence[Group]) -> tuple[list[str], list[str]]:
    """Return the names of the metrics of boxes, and of those of poses, in order."""
    names = list(dict.fromkeys(name for group in found for name in group.metrics))
    first = names.index(POSES) if POSES in names else len(names)
    return names[:first], names[first:]


def _pose_metrics(shown: Sequence[Judged]) -> dict[str, float]:
    found = [j.pose for j in shown if j.pose is not None]
    metrics = {
        POSES: len(found) / len(shown),
        "ADD < 0.1 d": sum(pose.add < _CORRECT_ADD_DIAMETERS for pose in found) / len(shown),
        "ADI < 0.1 d": sum(pose.adi < _CORRECT_ADD_DIAMETERS for pose in found) / len(shown),
    }
    if not found:
        return metrics
    e_t, e_q = np.array([(pose.e_t, pose.e_q_rad) for pose in found]).T
    return {
        **metrics,
        "ADD median, d": float(np.median([pose.add for pose in found])),
        "ADI median, d": float(np.median([pose.adi for pose in found])),
        "e_t median": float(np.median(e_t)),
        "e_q median, deg": float(np.rad2deg(np.median(e_q))),
        "SPEED 2019": speed_score(e_t, e_q, "2019"),
        "SPEED 2021": speed_score(e_t, e_q, "2021"),
        "SPEED 2023": speed_score(e_t, e_q, "2023"),
    }


def _members(dataset: LabelledImages, judged: Sequence[Judged]) -> Iterator[tuple[str, list[int]]]:
    everything = list(range(len(judged)))
    lines = [j.labels for j in judged]
    yield "all", everything
    names = sorted({line.spacecraft for line in lines if line.has("spacecraft")})
    if len(names) > 1:
        for name in names:
            yield (
                name,
                [i for i in everything if getattr(lines[i], "spacecraft", None) == name],
            )
    if isinstance(dataset, Dataset) and lines[0].has("range_m"):
        ranges = np.array([line.range_m for line in lines])
        for quarter in np.array_split(np.argsort(ranges, kind="stable"), 4):
            if len(quarter):
                yield f"{ranges[quarter[0]]:.3g}-{ranges[quarter[-1]]:.3g} m", quarter.tolist()
        phases = np.rad2deg([line.phase_angle_rad for line in lines])
        for low, high in pairwise(_PHASES_DEG):
            members = np.flatnonzero((phases >= low) & (phases < high))
            if len(members):
                yield f"phase {low}-{high} deg", members.tolist()
        behind = backgrounds(dataset, lines)
        for background in BACKGROUNDS:
            if background in behind:
                yield f"in front of {background}", [i for i in everything if behind[i] == background]
