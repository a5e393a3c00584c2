"""Keypoints and pose of a detection, with a second look where the first shows that the box was poor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from posse_core._arrays import AnyArray, FloatArray
from posse_core._detection.pnp import solve_pose
from posse_core._detection.shapes import Shapes, Sighting
from posse_core._evaluation.metrics import box_iou
from posse_core._interfaces.detector import Detection, KeypointFinder, PoseEstimate
from posse_core._interfaces.trust import TRUSTED
from posse_core._model.camera import Camera

_GOOD_BOX = 0.8
"""A box that overlaps that of the mesh at the pose by more is good: intersection over union."""
_ENOUGH_OF_SCORE = 1 / 3
"""Share of the least score that is enough where the pose is trusted."""
_ONE = 0.7
"""Detections of a class whose boxes overlap by more are of one spacecraft."""


def sightings_of(
    detections: Sequence[Detection],
    finder: KeypointFinder,
    image: AnyArray,
    camera: Camera,
    shapes: Shapes | None,
    least_score: float,
    sun_direction_cam: FloatArray | None,
) -> tuple[list[Sighting], list[Detection]]:
    """Find the poses of what was detected in an image, and drop detections that are none.

    A detection below the least score counts if its pose is trusted, and one spacecraft counts once.

    Args:
        detections: best first, without keypoints.
        finder, image, camera, shapes: as of :func:`look`.
        least_score: of a detection.
        sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, by which poses are refined;
            None where it is not known.

    Returns:
        The spacecraft, those with a trusted pose first, and then by their scores; and the detections
        that were dropped.
    """
    enough = _ENOUGH_OF_SCORE * least_score
    dropped = [detection for detection in detections if detection.score < enough]
    looks = [
        (detection, *look(finder, image, detection, camera, shapes))
        for detection in detections
        if detection.score >= enough
    ]
    looks.sort(key=lambda each: not _is_trusted(each[2]))  # stable
    seen: list[Sighting] = []
    for detection, found, pose in looks:
        if detection.score < least_score and not _is_trusted(pose):
            dropped.append(detection)
            continue
        sighting = Sighting(found, pose, start=pose)
        if shapes is not None:
            sighting = shapes.seen(image, found, pose, camera, sun_direction_cam)
        if any(_is_same(sighting.detection, other.detection) for other in seen):
            dropped.append(detection)
        else:
            seen.append(sighting)
    return seen, dropped


def _is_trusted(pose: PoseEstimate | None) -> bool:
    return pose is not None and pose.trust >= TRUSTED


def _is_same(one: Detection, other: Detection) -> bool:
    return one.label == other.label and float(box_iou(one.box_px, other.box_px)) > _ONE


def look(
    finder: KeypointFinder, image: AnyArray, detection: Detection, camera: Camera, shapes: Shapes | None
) -> tuple[Detection, PoseEstimate | None]:
    """Find the keypoints of a detection, and the pose that they agree on.

    Keypoints are found in a square around the box. Where the mesh at the pose has another box, they are
    found again around that one, and the pose with more trust is taken.

    Args:
        finder: of the keypoints.
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        detection: its box; keypoints are not needed.
        camera: that took the image.
        shapes: the spacecraft of which meshes are known, or None.

    Returns:
        The detection with keypoints; and the pose, or None if fewer than four keypoints agree on one.
    """
    first, pose = _found(finder, image, detection, camera)
    mesh_px = None if pose is None or shapes is None else shapes.box_px(first.label, pose, camera)
    if pose is None or mesh_px is None or float(box_iou(mesh_px, first.box_px)) > _GOOD_BOX:
        return first, pose
    second, again = _found(finder, image, replace(detection, box_px=mesh_px), camera)
    return (second, again) if again is not None and again.trust > pose.trust else (first, pose)


def _found(
    finder: KeypointFinder, image: AnyArray, detection: Detection, camera: Camera
) -> tuple[Detection, PoseEstimate | None]:
    (found,) = finder.find(image, [detection])
    if found.keypoints_px is None or found.keypoints_sigma_px is None:
        return found, None
    points_body_m = finder.keypoints_body_m[found.label]
    pose = solve_pose(points_body_m, found.keypoints_px, found.keypoints_sigma_px, camera)
    return found, None if pose is None else replace(pose, detection=found)
