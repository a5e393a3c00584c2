"""What each reading says of the motion: residual, derivative, noise.

A residual is what the motion predicts minus what was read. The error of the camera's known attitude, a
small rotation in camera axes, is the same for all points of a frame, so it is a fully correlated part of
a frame's noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray, IntArray
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.navigator import KeypointReading, LineOfSight, RangeReading
from posse_core._model.camera import Camera
from posse_core._navigation.kinematics import ATTITUDE, POSITION, SIZE, Kinematics


@dataclass(frozen=True)
class Eye:
    """The camera as the chaser knows it at one instant.

    Attributes:
        camera: its intrinsics.
        R_cam_from_eci: (3, 3) its attitude.
        sigma_rad: standard deviation of that attitude, about each axis.
    """

    camera: Camera
    R_cam_from_eci: FloatArray
    sigma_rad: float

    def R_cam_from_body(self, x: Kinematics) -> FloatArray:
        """(..., 3, 3) the target's attitude in camera axes."""
        return np.asarray(self.R_cam_from_eci @ x.R_eci_from_body)

    def origin_cam_m(self, x: Kinematics) -> FloatArray:
        """(..., 3) position of the target's origin in camera axes."""
        return np.asarray(-x.dr_eci_m @ self.R_cam_from_eci.T)


@dataclass(frozen=True)
class Keypoints:
    """Keypoints in the image; K of them.

    Attributes:
        eye: the camera.
        read: the reading; its points may be those of the body turned by a symmetry.
        slots: (K,) which of the belief's biases are theirs.
        noise_scale: factor on the variances of the reading.
        diameter_m: the target's.
    """

    eye: Eye
    read: KeypointReading
    slots: IntArray
    noise_scale: float
    diameter_m: float

    def _points_cam_m(self, x: Kinematics) -> FloatArray:
        R = self.eye.R_cam_from_body(x)
        points = np.einsum("...ij,kj->...ki", R, self.read.points_body_m)
        return np.asarray(points + self.eye.origin_cam_m(x)[..., None, :])

    def residual(self, x: Kinematics) -> FloatArray:
        away = self.eye.camera.project(self._points_cam_m(x)) - self.read.points_px
        return away.reshape(*away.shape[:-2], -1)

    def jacobian(self, x: Kinematics) -> FloatArray:
        by_point = self.eye.camera.project_jacobian(self._points_cam_m(x))
        matrix = np.zeros((by_point.shape[0], 2, SIZE))
        matrix[:, :, POSITION] = -by_point @ self.eye.R_cam_from_eci
        turned = self.eye.R_cam_from_body(x) @ -frames.cross_matrix(self.read.points_body_m)
        matrix[:, :, ATTITUDE] = by_point @ turned
        return matrix.reshape(-1, SIZE)

    def noise(self, x: Kinematics) -> FloatArray:
        """(2 K, 2 K) covariance of the residual's noise."""
        points = self._points_cam_m(x)
        by_camera = self.eye.camera.project_jacobian(points) @ -frames.cross_matrix(points)
        shared = self.eye.sigma_rad * by_camera.reshape(-1, 3)
        own = np.repeat(self.noise_scale * np.asarray(self.read.sigma_px) ** 2, 2)
        return np.asarray(shared @ shared.T + np.diag(own))

    def by_biases(self, x: Kinematics, count: int) -> FloatArray:
        """(2 K, 2 M) derivative of the residual by the shares of ``count`` = M keypoints."""
        size_px = self.eye.camera.fx_px * self.diameter_m / np.linalg.norm(x.dr_eci_m)
        matrix = np.zeros((len(self.slots), 2, count, 2))
        rows = np.arange(len(self.slots))
        matrix[rows, :, self.slots, :] = size_px * np.eye(2)
        return matrix.reshape(2 * len(rows), 2 * count)


@dataclass(frozen=True)
class Pose:
    """A pose in camera axes, its residual as a small rotation and a position, both in camera axes.

    Attributes:
        eye: the camera.
        R_cam_from_body: (3, 3) as read, up to a symmetry of the body.
        t_body_cam_m: (3,).
        covariance: (6, 6) of its own errors.
    """

    eye: Eye
    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, eye: Eye, pose: PoseEstimate, symmetry: FloatArray, inflation: float) -> Pose:
        """A pose seen as turned by a symmetry (3, 3), its standard deviations inflated."""
        turned = pose.R_cam_from_body @ symmetry.T
        return cls(eye, turned, pose.t_body_cam_m, inflation**2 * pose.covariance)

    def residual(self, x: Kinematics) -> FloatArray:
        turn = self.eye.R_cam_from_body(x) @ self.R_cam_from_body.T
        away = self.eye.origin_cam_m(x) - self.t_body_cam_m
        return np.concatenate([frames.rotation_vector_from_matrix(turn), away], axis=-1)

    def jacobian(self, x: Kinematics) -> FloatArray:
        matrix = np.zeros((6, SIZE))
        turn = frames.rotation_vector_from_matrix(self.eye.R_cam_from_body(x) @ self.R_cam_from_body.T)
        by_turn = np.linalg.inv(frames.right_jacobian(turn)) @ self.R_cam_from_body
        matrix[:3, ATTITUDE] = by_turn
        matrix[3:, POSITION] = -self.eye.R_cam_from_eci
        return matrix

    def noise(self, x: Kinematics) -> FloatArray:
        """(6, 6) covariance of the residual's noise."""
        by_camera = np.concatenate([np.eye(3), -frames.cross_matrix(self.t_body_cam_m)])
        return np.asarray(self.covariance + self.eye.sigma_rad**2 * by_camera @ by_camera.T)


@dataclass(frozen=True)
class Sight:
    """The direction to the target: its components along two axes across the direction that was read."""

    eye: Eye
    read: LineOfSight

    @cached_property
    def _across(self) -> FloatArray:
        return frames.R_with_z(frames.unit(self.read.direction_cam))[:, :2].T

    def residual(self, x: Kinematics) -> FloatArray:
        return np.asarray(frames.unit(self.eye.origin_cam_m(x)) @ self._across.T)

    def jacobian(self, x: Kinematics) -> FloatArray:
        origin = self.eye.origin_cam_m(x)
        length = np.linalg.norm(origin)
        direction = origin / length
        matrix = np.zeros((2, SIZE))
        by_origin = (np.eye(3) - np.outer(direction, direction)) / length
        matrix[:, POSITION] = -self._across @ by_origin @ self.eye.R_cam_from_eci
        return matrix

    def noise(self, x: Kinematics) -> FloatArray:
        """(2, 2) covariance of the residual's noise."""
        return np.eye(2) * (self.read.sigma_rad**2 + self.eye.sigma_rad**2)


@dataclass(frozen=True)
class Distance:
    """The distance to the target."""

    read: RangeReading

    def residual(self, x: Kinematics) -> FloatArray:
        return np.asarray(np.linalg.norm(x.dr_eci_m, axis=-1, keepdims=True) - self.read.range_m)

    def jacobian(self, x: Kinematics) -> FloatArray:
        matrix = np.zeros((1, SIZE))
        matrix[0, POSITION] = frames.unit(x.dr_eci_m)
        return matrix

    def noise(self, x: Kinematics) -> FloatArray:
        """(1, 1) variance of the residual's noise."""
        return np.array([[self.read.sigma_m**2]])
