"""Evaluation of a detector, and of the poses from its keypoints, on frames of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._detection.fitting import MIN_POINTS
from posse_core._detection.looking import sightings_of
from posse_core._detection.parts import found_in_parts
from posse_core._detection.pose_detector import LEAST_SCORE
from posse_core._detection.shapes import Shapes, Sighting
from posse_core._errors import InputError
from posse_core._evaluation.metrics import TrueBox, box_iou, matches, seen_bodies, true_box
from posse_core._evaluation.poses import add_m, adi_m, nees, pose_errors
from posse_core._frames import matrix_from_quaternion
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder, PoseEstimate
from posse_core._interfaces.trust import ANGLE_RAD, RANGE_SHARE
from posse_core._model.label_line import BodyLabels, LabelLine

LEAST_FLUX_W_M2 = 1.0
"""Sunlight below this flux is lost in any other light: it is 50 W/m² at Jupiter."""


@dataclass(frozen=True)
class PoseErrors:
    """The errors of an estimated pose.

    Attributes:
        e_t: position error divided by the range.
        e_q_rad: attitude error, the smallest over the spacecraft's symmetries.
        add, adi: mean distance of the mesh's vertices (ADD and ADI), divided by its diameter.
        nees: normalised estimation error squared, by the pose's covariance.
        trust: probability of being right that the pose's covariance gives.
    """

    e_t: float
    e_q_rad: float
    add: float
    adi: float
    nees: float
    trust: float

    @property
    def is_right(self) -> bool:
        """Whether the pose is what its trust is the probability of."""
        return self.e_t < RANGE_SHARE and self.e_q_rad < ANGLE_RAD


@dataclass(frozen=True)
class JudgedBody:
    """A craft that an image shows, and how it was found.

    Attributes:
        labels: its labels.
        truth: its true box.
        overlap: IoU with the detection that it is judged by (:func:`matches`), 0 if there is none.
        is_posed: whether keypoints of its class were sought, from which a pose follows.
        pose: errors of that pose, if the detection is among the best of the image, as many as it shows
            craft, and its keypoints gave a pose. They are those after refinement.
        start: errors before refinement; None if nothing was to be refined.
        is_refined: whether the refiner accepted its result.
    """

    labels: BodyLabels
    truth: TrueBox
    overlap: float
    is_posed: bool
    pose: PoseErrors | None
    start: PoseErrors | None = None
    is_refined: bool = False


@dataclass(frozen=True)
class FalsePose:
    """A pose of what is no spacecraft.

    Attributes:
        label: the class that was found.
        trust: probability of being right that the pose's covariance gives.
    """

    label: str
    trust: float


@dataclass(frozen=True)
class Judged:
    """The detections in one frame and their errors.

    Attributes:
        labels: the frame's label line.
        bodies: the craft that it shows, of classes that the detector knows.
        detections: what was found, best first.
        false_poses: those of detections that are more than the craft it shows.
    """

    labels: LabelLine
    bodies: Sequence[JudgedBody]
    detections: Sequence[Detection]
    false_poses: Sequence[FalsePose] = ()

    @property
    def truths(self) -> list[TrueBox]:
        """The true boxes."""
        return [body.truth for body in self.bodies]


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
    shapes: Shapes | None = None,
) -> list[Judged]:
    """What a :class:`Judge` of these says of frames."""
    judge = Judge(dataset, detector, finder, shapes)
    return [judge.make(i) for i in positions]


class Judge:
    """Compares what a detector finds in frames with their labels.

    Bodies beside the target count if the detector knows their class. With a keypoint finder, poses are
    evaluated too; with shapes, boxes are those of meshes at the poses, and poses may be refined, by the
    labelled direction of the Sun.

    Attributes:
        dataset: of the frames.
    """

    def __init__(
        self,
        dataset: LabelledImages,
        detector: Detector,
        finder: KeypointFinder | None = None,
        shapes: Shapes | None = None,
    ) -> None:
        """Take models that know the classes of all targets.

        Raises:
            InputError: a model does not know one.
        """
        for model in (detector, finder):
            missing = sorted(set(dataset.spacecraft_by_name) - set(model.classes)) if model else []
            if model and missing:
                raise InputError(
                    f"the model does not know {', '.join(missing)}, which {dataset.folder} contains; it"
                    f" knows {', '.join(model.classes)}"
                )
        self.dataset, self._detector, self._finder, self._shapes = dataset, detector, finder, shapes
        self._posed_classes = {
            name for name in dataset.classes if finder is not None and _gives_poses(finder, name)
        }

    def make(self, index: int) -> Judged:
        """Judge the frame at a position of the dataset.

        Raises:
            InputError: the labels lack what is measured.
        """
        dataset, detector, finder = self.dataset, self._detector, self._finder
        labels, image = dataset[index], dataset.image(index)
        seen = {
            name: body
            for name, body in seen_bodies(labels).items()
            if body.spacecraft in detector.classes
        }
        found = [d for d in detector.predict([image])[0] if d.label in dataset.classes]
        sightings: list[Sighting] = []
        others = found
        if finder is not None:
            posed = [d for d in found if d.label in self._posed_classes]
            sun_cam = sun_direction_cam(labels)
            closer = partial(found_in_parts, detector, image, self._posed_classes)
            sightings, dropped = sightings_of(
                posed, finder, image, dataset.camera, self._shapes, LEAST_SCORE, sun_cam, closer
            )
            others = dropped + [d for d in found if d.label not in self._posed_classes]
        sightings += [Sighting(detection, None) for detection in others]
        bodies = _judged(dataset, seen, sightings, finder)
        false = [
            FalsePose(each.detection.label, each.pose.trust)
            for each in sightings[len(seen) :]
            if each.pose is not None
        ]
        return Judged(labels, bodies, [each.detection for each in sightings], false)

    def close(self) -> None:
        """Close what refines poses."""
        if self._shapes is not None:
            self._shapes.close()


def sun_direction_cam(labels: LabelLine) -> FloatArray | None:
    """(3,) where the target's labels say that the Sun is, camera axes; None where they do not, or the
    Sun is not what lights the target: in the Earth's shadow, and between the lamps of a laboratory."""
    if not (labels.has("sun_direction_body") and labels.has("q_cam_from_body")):
        return None
    if labels.has("solar_flux_w_m2") and labels.solar_flux_w_m2 < LEAST_FLUX_W_M2:
        return None
    if labels.has("sun_fraction_target") and labels.sun_fraction_target == 0:
        return None
    R = matrix_from_quaternion(np.array(labels.q_cam_from_body))
    return np.asarray(R @ np.array(labels.sun_direction_body))


def _judged(
    dataset: LabelledImages,
    seen: Mapping[str | None, BodyLabels],
    sightings: Sequence[Sighting],
    finder: KeypointFinder | None,
) -> list[JudgedBody]:
    truths, found = [true_box(body) for body in seen.values()], [each.detection for each in sightings]
    bodies = []
    for (name, body), truth, place in zip(seen.items(), truths, matches(truths, found), strict=True):
        overlap = 0.0 if place is None else float(box_iou(found[place].box_px, truth.box_px))
        is_posed = finder is not None and _gives_poses(finder, truth.label)
        pose, start, is_refined = None, None, False
        if is_posed and place is not None and place < len(seen):
            sighting = sightings[place]
            pose = None if sighting.pose is None else _errors(dataset, name, body, sighting.pose)
            if sighting.refinement is not None and sighting.start is not None:
                start = _errors(dataset, name, body, sighting.start)
                is_refined = sighting.refinement.is_better
        bodies.append(JudgedBody(body, truth, overlap, is_posed, pose, start, is_refined))
    return bodies


def _gives_poses(finder: KeypointFinder, label: str) -> bool:
    """Whether a finder knows enough keypoints of a class."""
    if label not in finder.classes:
        return False
    return int(np.isfinite(finder.keypoints_body_m[label]).all(axis=1).sum()) >= MIN_POINTS


def _errors(
    dataset: LabelledImages, name: str | None, labels: BodyLabels, pose: PoseEstimate
) -> PoseErrors:
    if not labels.has("q_cam_from_body"):
        raise InputError(
            f"{dataset.folder}: the labels have no poses; make the dataset with the annotator 'pose'"
        )
    info, mesh = _shape(dataset, name, labels.spacecraft)
    R, t = matrix_from_quaternion(np.array(labels.q_cam_from_body)), np.array(labels.t_body_cam_m)
    estimated = pose.R_cam_from_body, pose.t_body_cam_m
    e_t, e_q_rad = pose_errors(R, t, *estimated, info.symmetries)
    points, diameter_m = mesh.vertices_body_m, mesh.diameter_m
    add, adi = (measure(points, R, t, *estimated) / diameter_m for measure in (add_m, adi_m))
    within = nees(R, t, *estimated, pose.covariance, info.symmetries)
    return PoseErrors(e_t, e_q_rad, add, adi, within, pose.trust)


def _shape(dataset: LabelledImages, name: str | None, spacecraft: str) -> tuple[SpacecraftInfo, Mesh]:
    """What the target or, by its name, a body beside it is; its mesh is with all joints at zero."""
    if name is not None and isinstance(dataset, Dataset):
        return dataset.bodies[name], dataset.body_mesh(name)
    return dataset.classes[spacecraft], dataset.mesh(spacecraft)
