"""Metrics of groups of frames: by class, range, phase angle and background."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import chi2, mannwhitneyu

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.images import LabelledImages
from posse_core._detection.background import BACKGROUNDS, backgrounds
from posse_core._detection.evaluate import Judged, JudgedBody
from posse_core._detection.glossary import POSES
from posse_core._evaluation.metrics import coco_metrics
from posse_core._evaluation.poses import speed_score
from posse_core._interfaces.trust import TRUSTED
from posse_core._model.label_line import LabelLine

_PHASES_DEG = (0, 30, 60, 90, 120, 180)
_CHI_SQUARED_95 = float(chi2.ppf(0.95, 6))
_CORRECT_ADD_DIAMETERS = 0.1
"""A pose is correct if its ADD is below this share of the diameter (Hinterstoisser et al. 2012)."""


@dataclass(frozen=True)
class Group:
    """A group of frames and its metrics."""

    name: str
    frames: int
    metrics: Mapping[str, float]


def groups(dataset: LabelledImages, judged: Sequence[Judged]) -> list[Group]:
    """Return the metrics of all frames, then by class, quartile of range, phase angle and background.

    A frame is in the group of each class of which a craft is in it, and there it counts with the craft
    of that class alone. Bodies beside the target whose class the detector does not know have no group.
    Range, phase angle and background are those of the target; there, a frame counts with all craft that
    it shows. Where keypoints were sought, the metrics include the share of craft whose pose was
    estimated, and the errors of these poses.

    Args:
        dataset: of the frames.
        judged: the evaluated frames.
    """
    classes = sorted(dataset.classes)
    result = []
    for name, mine in _members(dataset, judged):
        metrics = coco_metrics([j.truths for j in mine], [j.detections for j in mine], classes)
        bodies = [body for j in mine for body in j.bodies]
        if bodies:
            metrics["box IoU mean"] = float(np.mean([body.overlap for body in bodies]))
            metrics["box IoU median"] = float(np.median([body.overlap for body in bodies]))
        posed = [body for body in bodies if body.is_posed]
        if posed:
            metrics |= _pose_metrics(posed) | _trust_metrics(mine)
        result.append(Group(name, len(mine), metrics))
    return result


def columns(found: Sequence[Group]) -> tuple[list[str], list[str]]:
    """Return the names of the metrics of boxes, and of those of poses, in order."""
    names = list(dict.fromkeys(name for group in found for name in group.metrics))
    first = names.index(POSES) if POSES in names else len(names)
    return names[:first], names[first:]


def _pose_metrics(shown: Sequence[JudgedBody]) -> dict[str, float]:
    found = [body.pose for body in shown if body.pose is not None]
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
        **_refinement_metrics(shown),
        "ADD median, d": float(np.median([pose.add for pose in found])),
        "ADI median, d": float(np.median([pose.adi for pose in found])),
        "e_t median": float(np.median(e_t)),
        "e_q median, deg": float(np.rad2deg(np.median(e_q))),
        "e_t 90th percentile": float(np.percentile(e_t, 90)),
        "e_q 90th percentile, deg": float(np.rad2deg(np.percentile(e_q, 90))),
        "NEES median": float(np.median([pose.nees for pose in found])),
        "in 95 % region": float(np.mean([pose.nees < _CHI_SQUARED_95 for pose in found])),
        "SPEED 2019": speed_score(e_t, e_q, "2019"),
        "SPEED 2021": speed_score(e_t, e_q, "2021"),
        "SPEED 2023": speed_score(e_t, e_q, "2023"),
    }


def _trust_metrics(judged: Sequence[Judged]) -> dict[str, float]:
    """How well the trust tells poses that are right from those that are wrong."""
    told = trusts(judged)
    if not told:
        return {}
    trust, right = (np.array(column) for column in zip(*told, strict=True))
    metrics = {"right": float(np.mean(right)), "trust mean": float(np.mean(trust))}
    if 0 < right.sum() < len(right):
        # The area under the curve is that of Mann and Whitney's statistic.
        pairs = right.sum() * (len(right) - right.sum())
        metrics["trust AUC"] = float(mannwhitneyu(trust[right], trust[~right]).statistic / pairs)
    metrics["trusted"] = float(np.mean(trust >= TRUSTED))
    if metrics["trusted"]:
        metrics["right if trusted"] = float(np.mean(right[trust >= TRUSTED]))
    return metrics


def trusts(judged: Sequence[Judged]) -> list[tuple[float, bool]]:
    """Return the trust of each estimated pose, and whether the pose is right; one of a detection that
    is no spacecraft is not."""
    of_bodies = [(body.pose.trust, body.pose.is_right) for j in judged for body in j.bodies if body.pose]
    return of_bodies + [(false.trust, False) for j in judged for false in j.false_poses]


def _refinement_metrics(shown: Sequence[JudgedBody]) -> dict[str, float]:
    """What refinement changed, of the poses that were to be refined."""
    pairs = [(body.start, body.pose, body.is_refined) for body in shown if body.start and body.pose]
    if not pairs:
        return {}
    worse = [
        after.e_t + after.e_q_rad > before.e_t + before.e_q_rad
        for before, after, is_refined in pairs
        if is_refined
    ]
    return {
        "e_t before": float(np.median([before.e_t for before, _, _ in pairs])),
        "e_q before, deg": float(np.rad2deg(np.median([before.e_q_rad for before, _, _ in pairs]))),
        "refined": sum(is_refined for _, _, is_refined in pairs) / len(pairs),
        **({"worsened": float(np.mean(worse))} if worse else {}),
    }


def _members(
    dataset: LabelledImages, judged: Sequence[Judged]
) -> Iterator[tuple[str, Sequence[Judged]]]:
    lines = [j.labels for j in judged]
    yield "all", judged
    targets = {line.spacecraft for line in lines if line.has("spacecraft")}
    names = sorted(targets | {body.truth.label for j in judged for body in j.bodies})
    if len(names) > 1:
        for name in names:
            yield name, [_of_class(j, name) for j in judged if name in _names(j.labels)]
    if isinstance(dataset, Dataset) and lines[0].has("range_m"):
        ranges = np.array([line.range_m for line in lines])
        for quarter in np.array_split(np.argsort(ranges, kind="stable"), 4):
            if len(quarter):
                between = f"{ranges[quarter[0]]:.3g}-{ranges[quarter[-1]]:.3g} m"
                yield between, [judged[i] for i in quarter.tolist()]
        phases = np.rad2deg([line.phase_angle_rad for line in lines])
        for low, high in pairwise(_PHASES_DEG):
            members = [j for j, phase in zip(judged, phases, strict=True) if low <= phase < high]
            if members:
                yield f"phase {low}-{high} deg", members
        behind = backgrounds(dataset, lines)
        for background in BACKGROUNDS:
            if background in behind:
                members = [
                    j for j, is_behind in zip(judged, behind, strict=True) if is_behind == background
                ]
                yield f"in front of {background}", members


def _names(labels: LabelLine) -> set[str]:
    """The classes of a frame's bodies, seen or not."""
    return {body.spacecraft for body in labels.instances.values() if body.has("spacecraft")}


def _of_class(judged: Judged, name: str) -> Judged:
    """A frame with the craft and the detections of one class alone."""
    return replace(
        judged,
        bodies=[body for body in judged.bodies if body.truth.label == name],
        detections=[found for found in judged.detections if found.label == name],
        false_poses=[false for false in judged.false_poses if false.label == name],
    )
