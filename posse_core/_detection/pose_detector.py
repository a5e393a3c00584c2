"""Pose of the spacecraft in an image: a model for boxes, one for keypoints, and PnP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from posse_core._arrays import AnyArray
from posse_core._detection.pnp import solve_pose
from posse_core._errors import InputError
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder, PoseEstimate
from posse_core._model.camera import Camera

LEAST_SCORE = 0.3
"""Detections below this score are dropped by default."""


class PoseDetector:
    """Finds spacecraft in images and, with a model for keypoints, their poses.

    :func:`posse_core.detector` opens one.

    Attributes:
        classes: names of the spacecraft that it knows.
    """

    def __init__(
        self, boxes: Detector, keypoints: KeypointFinder | None, least_score: float = LEAST_SCORE
    ) -> None:
        self.classes: Sequence[str] = boxes.classes
        self._boxes = boxes
        self._keypoints = keypoints
        self._least_score = least_score

    def detect(self, image: AnyArray) -> Sequence[Detection]:
        """Return the spacecraft in an image, best first, with keypoints if there is a model for them.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        """
        found = [d for d in self._boxes.predict([image])[0] if d.score >= self._least_score]
        return found if self._keypoints is None else self._keypoints.find(image, found)

    def pose(self, image: AnyArray, camera: Camera) -> PoseEstimate | None:
        """Return the pose of the spacecraft in an image.

        It is that of the best detection whose keypoints agree on a pose.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
            camera: the camera that took the image.

        Returns:
            The pose, or None if no spacecraft is found or no pose fits its keypoints.

        Raises:
            InputError: There is no model for keypoints.
        """
        poses = (self.pose_of(detection, camera) for detection in self.detect(image))
        return next((pose for pose in poses if pose is not None), None)

    def pose_of(self, detection: Detection, camera: Camera) -> PoseEstimate | None:
        """Return the pose of a detection, or None if fewer than four of its keypoints agree on one.

        Raises:
            InputError: There is no model for keypoints.
        """
        if self._keypoints is None:
            raise InputError("a pose needs keypoints; give a model that finds them")
        if detection.keypoints_px is None or detection.keypoints_sigma_px is None:
            return None
        points_body_m = self._keypoints.keypoints_body_m[detection.label]
        pose = solve_pose(points_body_m, detection.keypoints_px, detection.keypoints_sigma_px, camera)
        return None if pose is None else replace(pose, detection=detection)
