"""From an image to the pose of the spacecraft in it: a net for boxes, one for keypoints, and PnP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from posse_core._arrays import AnyArray
from posse_core._detection.pnp import PoseEstimate, solve_pose
from posse_core._errors import InputError
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder
from posse_core._model.camera import Camera

LEAST_SCORE = 0.3
"""Detections below this score are left out, if nothing else is asked for."""


class PoseDetector:
    """Finds spacecraft in images and, with a net for keypoints, their poses.

    Open one by :func:`posse_core.detector`.

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
        """Spacecraft in an image, best first, with their keypoints where there is a net for them.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        """
        found = [d for d in self._boxes.predict([image])[0] if d.score >= self._least_score]
        return found if self._keypoints is None else self._keypoints.find(image, found)

    def pose(self, image: AnyArray, camera: Camera) -> PoseEstimate | None:
        """Pose of the spacecraft in an image: of the best detection whose keypoints agree on one.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
            camera: that took the image.

        Returns:
            None where nothing is found, or no pose agrees with what is.

        Raises:
            InputError: there is no net for keypoints.
        """
        poses = (self.pose_of(detection, camera) for detection in self.detect(image))
        return next((pose for pose in poses if pose is not None), None)

    def pose_of(self, detection: Detection, camera: Camera) -> PoseEstimate | None:
        """Pose of one detection; None where fewer than four of its keypoints agree on one.

        Raises:
            InputError: there is no net for keypoints.
        """
        if self._keypoints is None:
            raise InputError("a pose needs keypoints; name a model that finds them")
        if detection.keypoints_px is None or detection.keypoints_sigma_px is None:
            return None
        points_body_m = self._keypoints.keypoints_body_m[detection.label]
        pose = solve_pose(points_body_m, detection.keypoints_px, detection.keypoints_sigma_px, camera)
        return None if pose is None else replace(pose, detection=detection)
