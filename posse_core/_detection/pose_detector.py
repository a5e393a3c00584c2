"""Pose of the spacecraft in an image: a model for boxes, one for keypoints, and PnP."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from posse_core._arrays import AnyArray, FloatArray
from posse_core._detection.looking import sightings_of
from posse_core._detection.parts import found_in_parts
from posse_core._detection.shapes import Shapes, Sighting
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
        self,
        boxes: Detector,
        keypoints: KeypointFinder | None,
        least_score: float = LEAST_SCORE,
        shapes: Shapes | None = None,
        target: str | None = None,
    ) -> None:
        self.classes: Sequence[str] = boxes.classes
        self._boxes = boxes
        self._keypoints = keypoints
        self._least_score = least_score
        self._shapes = shapes
        self._wanted = set(boxes.classes if target is None else [target])

    def detect(self, image: AnyArray) -> Sequence[Detection]:
        """Return the spacecraft in an image, best first, with keypoints if there is a model for them.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        """
        found = [d for d in self._found(image) if d.score >= self._least_score]
        return found if self._keypoints is None else self._keypoints.find(image, found)

    def sightings(
        self, image: AnyArray, camera: Camera, sun_direction_cam: FloatArray | None = None
    ) -> list[Sighting]:
        """Return the spacecraft in an image with their poses, most trusted first; those whose poses are
        hardly possible come last, by their scores.

        A third of the least score is enough for a detection whose pose is trusted. Where no pose is
        trusted, the image is searched in parts of half its size too, and a third of the least score is
        enough for the likeliest pose. Where the mesh of a spacecraft is known, its pose is refined, if
        that was asked for, and the box is that of the mesh at the pose.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
            camera: the camera that took the image.
            sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, camera axes, by which
                poses are refined; None where it is not known.

        Raises:
            InputError: There is no model for keypoints.
        """
        if self._keypoints is None:
            raise InputError("a pose needs keypoints; give a model that finds them")
        given = self._keypoints, image, camera, self._shapes, self._least_score, sun_direction_cam
        closer = partial(found_in_parts, self._boxes, image, self._wanted)
        return sightings_of(self._found(image), *given, closer)[0]

    def pose(
        self, image: AnyArray, camera: Camera, sun_direction_cam: FloatArray | None = None
    ) -> PoseEstimate | None:
        """Return the pose of the spacecraft in an image.

        It is the first of :meth:`sightings`, of those whose keypoints agree on a pose.

        Args:
            image, camera, sun_direction_cam: as of :meth:`sightings`.

        Returns:
            The pose, or None if no spacecraft is found or no pose fits its keypoints.

        Raises:
            InputError: There is no model for keypoints.
        """
        seen = self.sightings(image, camera, sun_direction_cam)
        return next((each.pose for each in seen if each.pose is not None), None)

    def _found(self, image: AnyArray) -> list[Detection]:
        """The boxes in an image; of the target alone, where one was named."""
        return [each for each in self._boxes.predict([image])[0] if each.label in self._wanted]

    def close(self) -> None:
        """Close what refines poses; it is opened again when it is needed."""
        if self._shapes is not None:
            self._shapes.close()
