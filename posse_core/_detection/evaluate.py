"""Evaluation of a detector, and of the poses from its keypoints, on frames of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.images import LabelledImages
from posse_core._detection.pnp import solve_pose
from posse_core._errors import InputError
from posse_core._evaluation.metrics import TrueBox, best_overlaps, true_boxes
from posse_core._evaluation.poses import add_m, adi_m, pose_errors
from posse_core._frames import matrix_from_quaternion
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder, PoseEstimate
from posse_core._model.label_line import LabelLine


@dataclass(frozen=True)
class PoseErrors:
    """The errors of an estimated pose.

    Attributes:
        e_t: position error divided by the range.
        e_q_rad: attitude error, the smallest over the spacecraft's symmetries.
        add, adi: mean distance of the mesh's vertices (ADD and ADI), divided by its diameter.
    """

    e_t: float
    e_q_rad: float
    add: float
    adi: float


@dataclass(frozen=True)
class Judged:
    """The detections in one frame and their errors.

    Attributes:
        labels: the frame's label line.
        truths: the true boxes.
        detections: what was found, best first.
        overlaps: IoU of each true box with the best detection of its class, 0 if there is none.
        pose: errors of the best detection's pose, if its class is right and its keypoints gave a pose.
    """

    labels: LabelLine
    truths: Sequence[TrueBox]
    detections: Sequence[Detection]
    overlaps: Sequence[float]
    pose: PoseErrors | None


def frames_of(dataset: LabelledImages, part: str) -> list[int]:
    """Return the positions of the frames of a part; the part ``all`` has all frames.

    Raises:
        InputError: There is no such part, or it is empty.
    """
    positions = list(range(len(dataset))) if part == "all" else dataset.part(part)
    if not positions:
        raise InputError(f"{dataset.folder}: part {part!r} has no frames")
    return positions


def evaluate(
    dataset: LabelledImages,
    positions: Iterable[int],
    detector: Detector,
    finder: KeypointFinder | None = None,
) -> list[Judged]:
    """Compare what a detector finds in frames with their labels.

    With a keypoint finder, the pose of the best detection is evaluated too if its class is right.

    Raises:
        InputError: The labels lack what is measured, or a model does not know a class.
    """
    for model in (detector, finder):
        missing = sorted(set(dataset.spacecraft_by_name) - set(model.classes)) if model else []
        if model and missing:
            raise InputError(
                f"the model does not know {', '.join(missing)}, which {dataset.folder} contains; it"
                f" knows {', '.join(model.classes)}"
            )
    judged = []
    for i in positions:
        labels, image = dataset[i], dataset.image(i)
        truths = true_boxes(labels)
        found = [d for d in detector.predict([image])[0] if d.label in dataset.spacecraft_by_name]
        pose = None
        if (
            finder is not None
            and found
            and labels.has("spacecraft")
            and found[0].label == labels.spacecraft
        ):
            pose = _pose(dataset, labels, finder, image, found[0])
        judged.append(Judged(labels, truths, found, best_overlaps(truths, found), pose))
    return judged


def _pose(
    dataset: LabelledImages,
    labels: LabelLine,
    finder: KeypointFinder,
    image: AnyArray,
    best: Detection,
) -> PoseErrors | None:
    (found,) = finder.find(image, [best])
    assert found.keypoints_px is not None
    assert found.keypoints_sigma_px is not None
    points = finder.keypoints_body_m[found.label]
    pose = solve_pose(points, found.keypoints_px, found.keypoints_sigma_px, dataset.camera)
    return None if pose is None else _errors(dataset, labels, pose)


def _errors(dataset: LabelledImages, labels: LabelLine, pose: PoseEstimate) -> PoseErrors:
    if not labels.has("q_cam_from_body"):
        raise InputError(
            f"{dataset.folder}: the labels have no poses; make the dataset with the annotator 'pose'"
        )
    name = labels.spacecraft
    R, t = matrix_from_quaternion(np.array(labels.q_cam_from_body)), np.array(labels.t_body_cam_m)
    estimated = pose.R_cam_from_body, pose.t_body_cam_m
    e_t, e_q_rad = pose_errors(R, t, *estimated, dataset.spacecraft_by_name[name].symmetries)
    mesh = dataset.mesh(name)
    points, diameter_m = mesh.vertices_body_m, mesh.diameter_m
    add, adi = (measure(points, R, t, *estimated) / diameter_m for measure in (add_m, adi_m))
    return PoseErrors(e_t, e_q_rad, add, adi)
