"""From a frame to readings: what nets find in its image, or true projections with noise."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray
from posse_core._detection.fitting import MIN_POINTS
from posse_core._detection.hypotheses import poses_of
from posse_core._detection.models import open_models
from posse_core._detection.pnp import solve_pose
from posse_core._detection.pose_detector import PoseDetector
from posse_core._detection.shapes import Shapes
from posse_core._errors import InputError
from posse_core._flight.expected import NOTHING, Expected, PoseRefiner
from posse_core._interfaces.detector import Detection, PoseEstimate
from posse_core._interfaces.navigator import KeypointReading, LineOfSight, RangeReading, Readings
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine
from posse_core._plugins.registry import Registry
from posse_core._randomness import random_generator
from posse_core._scenario.flight import MeasurementConfig
from posse_core._simulator.frame import Frame

_MIDDLE_SHARE = 0.1
"""Standard deviation of the body's origin from the middle of its box, over the box's diagonal."""


class Craft(Protocol):
    """The name, the keypoints and the joints of a spacecraft."""

    @property
    def name(self) -> str: ...

    @property
    def keypoints_body_m(self) -> Mapping[str, FloatArray]: ...

    @property
    def keypoint_joints(self) -> Mapping[str, str]: ...

    @property
    def joints(self) -> Sequence[object]: ...


@dataclass(frozen=True)
class _Seen:
    """What was found in an image: keypoints, the box (4,) x, y, width, height, and the poses on which
    the keypoints may agree, likeliest first, where there are several."""

    keypoints: KeypointReading | None
    box_px: FloatArray
    poses: Sequence[PoseEstimate] = ()


class Eye(ABC):
    """Reads frames, by :func:`open_eye`."""

    def __init__(
        self,
        config: MeasurementConfig,
        craft: Craft,
        camera: Camera,
        seed: int,
        refiner: PoseRefiner | None = None,
    ) -> None:
        """refiner: of poses; None takes those of the keypoints."""
        self._config, self._craft, self._camera, self._seed = config, craft, camera, seed
        self._refiner = refiner

    def read(
        self,
        labels: LabelLine,
        image: AnyArray,
        q_eci_from_camera: FloatArray,
        expected: Expected = NOTHING,
    ) -> Readings:
        """The readings of a frame.

        Args:
            labels: the frame's true labels.
            image: (H, W) or (H, W, 3) its image.
            q_eci_from_camera: (4,) the camera's attitude as the chaser knows it.
            expected: what the chaser expected to see: keypoints are corrected by the frame, and poses
                refined from the pose.
        """
        config = self._config
        began_s = time.perf_counter()
        seen = self._look(labels, image)
        alone = None if seen is None or seen.keypoints is None else self._pose(seen.keypoints)
        refined = None
        if self._refiner is not None:
            found = [alone] if seen is None or not seen.poses else seen.poses
            poses = [pose for pose in found if pose is not None]
            refined = self._refiner.pose(image, poses, expected)
        took_s = time.perf_counter() - began_s
        arrives_s = labels.t_s + (took_s if config.delay_s == "measured" else config.delay_s)
        readings = Readings(labels.index, labels.t_s, arrives_s, q_eci_from_camera)
        if config.range_sigma_m is not None:
            noise = random_generator(self._seed, labels.index, "range-finder").standard_normal()
            range_m = labels.range_m + config.range_sigma_m * float(noise)
            readings = replace(readings, range=RangeReading(range_m, config.range_sigma_m))
        if refined is not None:
            return replace(readings, pose=refined, pose_alone=alone)
        if seen is None:
            return readings
        if config.use == "line-of-sight":
            return replace(readings, line_of_sight=self._line_of_sight(seen.box_px))
        if seen.keypoints is None:
            return readings
        keypoints, pose = seen.keypoints, alone
        if expected.frame is not None:
            keypoints = self._corrected(keypoints, expected.frame)
            pose = self._pose(keypoints)
        return replace(
            readings,
            keypoints=keypoints if config.use == "keypoints" else None,
            pose=pose,
            pose_alone=alone,
        )

    def close(self) -> None:
        """Close what refines poses."""
        if self._refiner is not None:
            self._refiner.close()

    @abstractmethod
    def _look(self, labels: LabelLine, image: AnyArray) -> _Seen | None:
        """What is found in a frame; None if that is nothing."""

    def _pose(self, found: KeypointReading) -> PoseEstimate | None:
        return solve_pose(found.points_body_m, found.points_px, found.sigma_px, self._camera)

    def _corrected(self, found: KeypointReading, expected: Frame) -> KeypointReading:
        """Keypoints without the error that is made in the expected frame, whose pose is known exactly.

        Nets err alike in images of nearly the same view, so most of an error that would stay for many
        frames is in both. Where nothing is found in the expected frame, nothing is taken off.
        """
        craft = expected.state.craft
        seen = self._look(expected.labels, expected.image)
        if seen is None or seen.keypoints is None:
            return found
        there_m = found.points_body_m @ craft.R_cam_from_body.T + craft.t_body_cam_m
        error_px = seen.keypoints.points_px - self._camera.project(there_m)
        known = np.isfinite(error_px).all(axis=1)
        return KeypointReading(
            found.points_body_m[known],
            (found.points_px - error_px)[known],
            found.sigma_px[known],
        )

    def _line_of_sight(self, box_px: FloatArray) -> LineOfSight:
        x, y, width, height = box_px
        middle_px = np.array([x + (width - 1) / 2, y + (height - 1) / 2])
        ray = self._camera.rays(middle_px)
        sigma_px = np.hypot(self._config.sigma_px, _MIDDLE_SHARE * np.hypot(width, height))
        return LineOfSight(ray / np.linalg.norm(ray), float(sigma_px * self._camera.pixel_rad))


class NetEye(Eye):
    """Finds the spacecraft and its keypoints by trained nets."""

    def __init__(
        self,
        config: MeasurementConfig,
        craft: Craft,
        camera: Camera,
        seed: int,
        detector: PoseDetector,
        refiner: PoseRefiner | None = None,
    ) -> None:
        super().__init__(config, craft, camera, seed, refiner)
        self._detector = detector
        body_m = np.array(list(craft.keypoints_body_m.values()))
        self._points_body_m = np.where(_fixed(craft)[:, None], body_m, np.nan)

    def _look(self, labels: LabelLine, image: AnyArray) -> _Seen | None:
        for detection in self._detector.detect(image):
            if detection.label != self._craft.name:
                continue
            poses, box_px = self._poses(detection), np.asarray(detection.box_px, np.float64)
            if poses:
                return _Seen(self._keypoints(poses[0]), box_px, poses)
            if detection.keypoints_px is None and self._config.use == "line-of-sight":
                return _Seen(None, box_px)
        return None

    def _poses(self, detection: Detection) -> list[PoseEstimate]:
        """The poses of a detection's keypoints; none where the net is not sure enough of them."""
        poses = poses_of(self._points_body_m, detection, self._camera)
        if not poses:
            return []
        if detection.places is not None:
            return poses if poses[0].trust >= self._config.least_trust else []
        side_px = float(np.max(detection.box_px[2:]))
        sigma_px = float(np.mean(np.asarray(detection.keypoints_sigma_px)))
        return poses if sigma_px <= self._config.largest_sigma * side_px else []

    def _keypoints(self, pose: PoseEstimate) -> KeypointReading:
        """The keypoints of a pose: of a net that tells several places of each, those that agree with it,
        since the others may be far off."""
        detection = pose.detection
        assert detection is not None  # as poses_of gives it
        assert detection.keypoints_px is not None
        assert detection.keypoints_sigma_px is not None
        read = _fixed(self._craft)
        if detection.places is not None:
            read = read & pose.inliers
        return KeypointReading(
            self._points_body_m[read],
            np.asarray(detection.keypoints_px, np.float64)[read],
            np.hypot(np.asarray(detection.keypoints_sigma_px, np.float64), self._config.sigma_px)[read],
        )


class TrueEye(Eye):
    """Takes the true projections of the keypoints in view, with white noise."""

    def _look(self, labels: LabelLine, image: AnyArray) -> _Seen | None:
        if labels.sun_fraction_target == 0 or labels.box_visible_px is None:
            return None
        names = [
            name
            for (name, point), is_fixed in zip(
                labels.keypoints.items(), _fixed(self._craft), strict=True
            )
            if point.visibility == 2 and is_fixed
        ]
        sigma_px = self._config.sigma_px
        noise = random_generator(self._seed, labels.index, "keypoint-noise").standard_normal(
            (len(labels.keypoints), 2)
        )
        at = [i for i, name in enumerate(labels.keypoints) if name in names]
        found = None
        if len(names) >= MIN_POINTS:
            true_px = np.array([labels.keypoints[name][:2] for name in names], dtype=np.float64)
            found = KeypointReading(
                np.array([self._craft.keypoints_body_m[name] for name in names]),
                true_px + sigma_px * noise[at],
                np.full(len(names), sigma_px),
            )
        return _Seen(found, np.array(labels.box_visible_px, dtype=np.float64))


def open_eye(
    config: MeasurementConfig,
    craft: Craft,
    camera: Camera,
    seed: int,
    registry: Registry,
    shapes: Shapes | None = None,
    *,
    where: str = "flight.measurement",
) -> Eye:
    """The eye that a scenario chooses.

    Args:
        shapes: meshes, and the refiner that ``config`` names; they are closed with the eye. None where
            poses are not refined.
        where: the key of ``config``, for messages.

    Raises:
        InputError: a model file cannot be used, or its classes or keypoints are not the spacecraft's; or
            poses cannot be refined, since there is no mesh without joints.
    """
    refiner = None
    if shapes is not None:
        if craft.name not in shapes or craft.joints:
            raise InputError(
                f"{where}.refiner: {craft.name!r} has joints that move, or its mesh is not known; say"
                " null"
            )
        refiner = PoseRefiner(shapes, craft.name, camera, config.least_trust)
    if config.source == "truth":
        return TrueEye(config, craft, camera, seed, refiner)
    try:
        detector, finder = open_models(
            config.boxes, config.keypoints, registry, {}, [craft.name], in_flight=True
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if craft.name not in detector.classes:
        raise InputError(
            f"{where}: the model finds {', '.join(detector.classes)}, not {craft.name!r};"
            " name one that was trained on it by boxes and keypoints, or take source: truth"
        )
    if config.use != "line-of-sight":
        known = None if finder is None else finder.keypoints_body_m.get(craft.name)
        mine = np.array(list(craft.keypoints_body_m.values()))
        if known is None or known.shape != mine.shape or not _agree(known, mine, _fixed(craft)):
            raise InputError(
                f"{where}.keypoints: the model does not find the keypoints of {craft.name!r};"
                " name one that was trained on this spacecraft"
            )
    finds = PoseDetector(detector, finder, config.least_score)
    return NetEye(config, craft, camera, seed, finds, refiner)


def _fixed(craft: Craft) -> BoolArray:
    """(K,) whether the body itself carries a keypoint, which then has a place in body axes."""
    return np.array([name not in craft.keypoint_joints for name in craft.keypoints_body_m], dtype=bool)


def _agree(known_body_m: FloatArray, mine_body_m: FloatArray, fixed: BoolArray) -> bool:
    """Whether keypoints (K, 3) that a model knows, NaN for those of joints, are a spacecraft's."""
    placed = np.isfinite(known_body_m).all(axis=1)
    is_same = np.allclose(known_body_m[placed], mine_body_m[placed], atol=1e-6)
    return bool(is_same and not (placed & ~fixed).any())
