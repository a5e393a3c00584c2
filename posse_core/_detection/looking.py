"""Keypoints and pose of a detection, with a second look where the first shows that the box was poor."""

from __future__ import annotations

from dataclasses import replace

from posse_core._arrays import AnyArray
from posse_core._detection.pnp import solve_pose
from posse_core._detection.shapes import Shapes
from posse_core._evaluation.metrics import box_iou
from posse_core._interfaces.detector import Detection, KeypointFinder, PoseEstimate
from posse_core._model.camera import Camera

_GOOD_BOX = 0.8
"""A box that overlaps that of the mesh at the pose by more is good: intersection over union."""


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
    return found, pose_of(finder, found, camera)


def pose_of(finder: KeypointFinder, detection: Detection, camera: Camera) -> PoseEstimate | None:
    """The pose of a detection, or None if fewer than four of its keypoints agree on one."""
    if detection.keypoints_px is None or detection.keypoints_sigma_px is None:
        return None
    points_body_m = finder.keypoints_body_m[detection.label]
    pose = solve_pose(points_body_m, detection.keypoints_px, detection.keypoints_sigma_px, camera)
    return None if pose is None else replace(pose, detection=detection)
