"""Keypoints and pose of a detection, with a second look where the first shows that the box was poor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._detection.hypotheses import is_known, poses_of, weighed
from posse_core._detection.parts import is_one
from posse_core._detection.shapes import Shapes, Sighting
from posse_core._detection.turned import seen_turned
from posse_core._evaluation.metrics import box_iou, box_share
from posse_core._interfaces.detector import Detection, KeypointFinder, PoseEstimate
from posse_core._interfaces.trust import TRUSTED
from posse_core._model.camera import Camera

_GOOD_BOX = 0.8
"""A box that overlaps that of the mesh at the pose by more is good: intersection over union."""
_WIDER = (1.6, 2.5)
"""Sides of the boxes that are looked at where the detector's gives no sure pose, over those of that."""
_LOOKS = 2
"""How often the mesh's box is followed at most."""
_SURE = 0.9
"""Trust of a pose from which neither a turned image nor a wider box is looked at."""
_MOST = 16
"""So many poses are told at most: each is one from which refinement starts."""
_ENOUGH_OF_SCORE = 1 / 3
"""Share of the least score that is enough where the pose is trusted, or the likeliest."""
_POSSIBLE, _LIKELY = 0.05, 0.25
"""Where no pose is trusted, the likeliest is told, whatever the score of its detection, if it is trusted
by the first. Once it was to be refined, the image has been compared with it: where nothing else is told,
it must be trusted by the second then."""
_CLOSEST = 12
"""So many detections of a closer search are looked at, the best. Where there is no spacecraft, there are
many with low scores, and the looks at one may take a second."""
_PART = 0.8
"""A box of which more lies in that of a spacecraft with a trusted pose is around a part of it."""


def sightings_of(
    detections: Sequence[Detection],
    finder: KeypointFinder,
    image: AnyArray,
    camera: Camera,
    shapes: Shapes | None,
    least_score: float,
    sun_direction_cam: FloatArray | None,
    closer: Callable[[], Sequence[Detection]],
) -> tuple[list[Sighting], list[Detection]]:
    """Find the poses of what was detected in an image, and drop detections that are none.

    A detection below the least score counts if its pose is trusted, and one spacecraft counts once.
    Where no pose is trusted, a closer search is made, and what it finds counts if its pose is trusted.
    If none is even then, the detection with the likeliest pose counts all the same, unless that is
    hardly possible: by scores alone, the brightest cloud would often be the spacecraft.

    Args:
        detections: best first, without keypoints.
        finder, image, camera, shapes: as of :func:`look`.
        least_score: of a detection.
        sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, by which poses are refined;
            None where it is not known.
        closer: makes the closer search; its detections are as those, and the first dozen is looked at.

    Returns:
        The spacecraft, most trusted first, and those whose poses are hardly possible last, by their
        scores; and the detections that were dropped.
    """
    enough = _ENOUGH_OF_SCORE * least_score
    dropped = [detection for detection in detections if detection.score < enough]

    def looked(found: Sequence[Detection]) -> list[_Look]:
        return [
            _Look(detection, *look(finder, image, detection, camera, shapes))
            for detection in found
            if detection.score >= enough
        ]

    looks = looked(detections)
    likeliest: _Look | None = None

    def counts(look: _Look) -> bool:
        return look.trust >= TRUSTED or look is likeliest

    if not any(each.trust >= TRUSTED for each in looks):
        more = [each for each in closer() if not any(is_one(each, known.detection) for known in looks)]
        closest = looked(more[:_CLOSEST])
        possible = [each for each in [*looks, *closest] if each.trust >= _POSSIBLE]
        likeliest = max(possible, key=lambda each: each.trust, default=None)
        looks += [each for each in closest if counts(each)]
    looks.sort(key=lambda each: not counts(each))  # stable
    seen: list[Sighting] = []
    for each in looks:
        detection, found, poses = each
        if detection.score < least_score and not counts(each):
            dropped.append(detection)
            continue
        pose = next(iter(poses), None)
        sighting = Sighting(found, pose, start=pose)
        if shapes is not None:
            # Refinement takes long: what is one of those that were seen already is not refined.
            mesh_px = None if pose is None else shapes.extent_px(found.label, pose, camera)
            if mesh_px is not None and _is_there(replace(found, box_px=mesh_px), seen):
                dropped.append(detection)
                continue
            sighting = shapes.seen(image, found, poses, camera, sun_direction_cam, detection.box_px)
        is_unlikely = detection.score < least_score and _trust(sighting.pose) < _POSSIBLE
        if is_unlikely or _is_there(sighting.detection, seen):
            dropped.append(detection)
        else:
            seen.append(sighting)
    # Refinement has told which poses the image agrees with. What is hardly trusted goes by its score.
    seen.sort(key=lambda sighting: -_trust(sighting.pose, _POSSIBLE))  # stable

    def is_doubtful(sighting: Sighting) -> bool:
        is_told = sighting.detection.score >= least_score or sighting.refinement is None
        return not is_told and _trust(sighting.pose) < _LIKELY

    whole: list[Sighting] = []
    for number, sighting in enumerate(seen):
        is_first_of_several = number == 0 and len(seen) > 1
        is_out = is_doubtful(sighting) and not is_first_of_several
        if is_out or _is_part(sighting.detection, whole):
            dropped.append(sighting.detection)
        else:
            whole.append(sighting)
    return whole, dropped


class _Look(NamedTuple):
    """What was found around a detection.

    Attributes:
        detection: as it was detected.
        found: with keypoints.
        poses: that they may agree on, most trusted first.
    """

    detection: Detection
    found: Detection
    poses: list[PoseEstimate]

    @property
    def trust(self) -> float:
        """The trust of the pose that is trusted most; 0 without one."""
        return _trust(next(iter(self.poses), None))


def _trust(pose: PoseEstimate | None, least: float = 0.0) -> float:
    """The trust of a pose that is trusted at least so much; 0 of others, and of none."""
    return pose.trust if pose is not None and pose.trust >= least else 0.0


def _is_part(part: Detection, others: Sequence[Sighting]) -> bool:
    """Whether a box is around a part of a spacecraft that has a trusted pose."""
    return any(
        float(box_share(part.box_px, other.detection.box_px)) > _PART
        for other in others
        if other.detection.label == part.label and _trust(other.pose) >= TRUSTED
    )


def _is_there(detection: Detection, seen: Sequence[Sighting]) -> bool:
    """Whether a detection is of one of the spacecraft that were seen."""
    return any(is_one(detection, sighting.detection) for sighting in seen)


def look(
    finder: KeypointFinder, image: AnyArray, detection: Detection, camera: Camera, shapes: Shapes | None
) -> tuple[Detection, list[PoseEstimate]]:
    """Find the keypoints of a detection, and the poses that they may agree on.

    Keypoints are found in a square around the box. Where the mesh at the pose has another box, they are
    found again around that one. Unless the pose is then almost sure, that square is looked at in the
    image turned by quarter turns too, and then wider squares in the same way as the first: of a
    spacecraft that is lit in part, detectors often find that part.

    Args:
        finder: of the keypoints.
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        detection: its box; keypoints are not needed.
        camera: that took the image.
        shapes: the spacecraft of which meshes are known, or None.

    Returns:
        The detection with the keypoints of the pose that is trusted most; and the poses that clearly
        differ, most trusted first, none where no four keypoints agree on one.
    """
    looks = _followed(finder, image, detection, camera, shapes)
    seen = [pose for _, poses in looks for pose in poses]
    if not _has_sure(seen):
        turned = seen_turned(finder, image, looks[-1][0])
        if turned is not None:
            looks[-1] = turned, poses_of(finder.keypoints_body_m[turned.label], turned, camera)
            seen = [pose for _, poses in looks for pose in poses]
    for wider in _WIDER:
        if _has_sure(seen):
            break
        wide = replace(detection, box_px=_wider(detection, wider))
        (first, poses), *others = _followed(finder, image, wide, camera, shapes)
        # The box that was widened stays that of the detection.
        unmoved = [replace(pose, detection=_with_box_of(detection, pose)) for pose in poses]
        there = [*unmoved, *(pose for _, poses in others for pose in poses)]
        seen += [pose for pose in there if _is_of(detection, pose, camera, shapes)]
        looks += [(first, poses), *others]
    different: list[PoseEstimate] = []
    for pose in sorted(seen, key=lambda pose: -pose.trust):
        if not is_known(pose.R_cam_from_body, different):
            different.append(pose)
    found = looks[0][0]
    points_body_m = finder.keypoints_body_m[found.label]
    told = weighed(different, points_body_m, [look for look, _ in looks], camera)
    told = sorted(told, key=lambda pose: -pose.trust)[:_MOST]
    return (told[0].detection or found if told else found), told


def _followed(
    finder: KeypointFinder,
    image: AnyArray,
    detection: Detection,
    camera: Camera,
    shapes: Shapes | None,
) -> list[tuple[Detection, list[PoseEstimate]]]:
    """Look around a box, and then around that of the mesh at the first pose, while that is another.

    Returns:
        What was found at each look: keypoints, and the poses that they may agree on.
    """
    looks: list[tuple[Detection, list[PoseEstimate]]] = []
    while len(looks) <= _LOOKS:
        (found,) = finder.find(image, [detection])
        poses = poses_of(finder.keypoints_body_m[found.label], found, camera)
        looks.append((found, poses))
        if not poses or shapes is None:
            break
        mesh_px = shapes.extent_px(found.label, poses[0], camera)
        if mesh_px is None or float(box_iou(mesh_px, found.box_px)) > _GOOD_BOX:
            break
        detection = replace(detection, box_px=mesh_px)
    return looks


def _has_sure(poses: Sequence[PoseEstimate]) -> bool:
    return any(pose.trust >= _SURE for pose in poses)


def _with_box_of(detection: Detection, pose: PoseEstimate) -> Detection:
    assert pose.detection is not None  # as poses_of gives it
    return replace(pose.detection, box_px=detection.box_px)


def _wider(detection: Detection, factor: float) -> FloatArray:
    x, y, width, height = detection.box_px
    x, y = x - (factor - 1) * width / 2, y - (factor - 1) * height / 2
    return np.array([x, y, factor * width, factor * height])


def _is_of(detection: Detection, pose: PoseEstimate, camera: Camera, shapes: Shapes | None) -> bool:
    """Whether a pose that was found in a wider square is of what was detected, and of no neighbour:
    whether the middle of the detection's box is in that of the mesh or else of the keypoints."""
    around_px = None if shapes is None else shapes.extent_px(detection.label, pose, camera)
    if around_px is None:
        assert pose.detection is not None
        assert pose.detection.keypoints_px is not None
        points_px = pose.detection.keypoints_px[pose.inliers]
        around_px = np.concatenate([points_px.min(axis=0), np.ptp(points_px, axis=0)])
    inside = (detection.box_px[:2] + detection.box_px[2:] / 2 - around_px[:2]) / around_px[2:]
    return bool(np.all((inside >= 0) & (inside <= 1)))
