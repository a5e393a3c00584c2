"""Residuals of readings: zero for the truth, derivatives by differences, noise by sampling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendezvous import CAMERA, POINTS_M

from posse_core import BrownConrady, Fisheye, KeypointReading, LineOfSight, PoseEstimate, RangeReading
from posse_core._frames import matrix_from_rotation_vector, unit
from posse_core._navigation.kinematics import Kinematics, moved_tangent
from posse_core._navigation.linearisation import SigmaPoints
from posse_core._navigation.measurements import Distance, Eye, Keypoints, Pose, Sight

KINDS = ["keypoints", "pose", "sight", "range"]
LENS = replace(CAMERA, distortion=BrownConrady(-0.1, 0.02, 1e-3, -5e-4, 0.0))
FISHEYE = replace(CAMERA, distortion=Fisheye(-0.02, 0.01, -0.003, 0.0005))


def scene(camera=CAMERA, R_body=(0.3, -0.8, 0.2), R_cam=(1.0, 0.4, -0.3), origin=(0.7, -0.4, 30.0)):
    """A motion, the camera, and the target's pose in camera axes."""
    R_cam_from_eci = matrix_from_rotation_vector(np.array(R_cam))
    dr = -R_cam_from_eci.T @ np.array(origin)
    x = Kinematics(dr, np.zeros(3), matrix_from_rotation_vector(np.array(R_body)), np.zeros(3))
    return x, Eye(camera, R_cam_from_eci, 2e-3)


def reading(kind: str, x: Kinematics, eye: Eye, R_error=None):
    """What is read of a motion without noise, by a camera that is turned by an error."""
    turn = np.eye(3) if R_error is None else R_error
    R, t = turn @ eye.R_cam_from_body(x), turn @ eye.origin_cam_m(x)
    if kind == "keypoints":
        px = eye.camera.project(POINTS_M @ R.T + t)
        read = KeypointReading(POINTS_M, px, np.full(len(px), 1e-9))
        return Keypoints(eye, read, np.arange(len(px)), 1.0, 6.0)
    if kind == "pose":
        pose = PoseEstimate(R, t, 1e-18 * np.eye(6), np.ones(11, bool), 1.0)
        return Pose.of(eye, pose, np.eye(3), 1.0)
    if kind == "sight":
        return Sight(eye, LineOfSight(unit(t), 1e-9))
    return Distance(RangeReading(float(np.linalg.norm(t)), 1.0))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("camera", [CAMERA, LENS, FISHEYE], ids=["pinhole", "lens", "fisheye"])
def test_the_truth_has_no_residual(kind, camera):
    x, eye = scene(camera)
    np.testing.assert_allclose(reading(kind, x, eye).residual(x), 0.0, atol=1e-12)


turns = st.tuples(*[st.floats(-1.5, 1.5)] * 3).map(np.array)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(R_body=turns, R_cam=turns, away=st.tuples(*[st.floats(-1, 1)] * 12).map(np.array))
def test_the_jacobian_is_the_derivative_of_the_residual(kind, R_body, R_cam, away):
    x, eye = scene(LENS, R_body, R_cam)
    read = reading(kind, x, eye)
    # Away from the truth, where the residual's own curvature matters.
    at = x.plus(0.2 * away)
    step = 1e-6
    errors = step * np.eye(12)
    difference = (read.residual(at.plus(errors)) - read.residual(at.plus(-errors))).T / (2 * step)
    scale = 1.0 + np.abs(difference).max()
    np.testing.assert_allclose(read.jacobian(at) / scale, difference / scale, atol=1e-6)


@pytest.mark.parametrize("kind", ["keypoints", "pose", "sight"])
def test_the_cameras_error_is_noise_of_all_points_together(kind):
    """Against residuals of the truth, as read by cameras that are turned at random."""
    x, eye = scene()
    rng = np.random.default_rng(0)
    residuals = [
        reading(kind, x, eye, matrix_from_rotation_vector(2e-3 * rng.standard_normal(3))).residual(x)
        for _ in range(4000)
    ]
    noise = reading(kind, x, eye).noise(x)
    np.testing.assert_allclose(noise, np.cov(np.array(residuals).T), atol=0.07 * np.max(noise))


def test_biases_shift_their_own_keypoints_by_a_share_of_the_targets_diameter():
    x, eye = scene(origin=(0.0, 0.0, 30.0))
    read = replace(reading("keypoints", x, eye), slots=np.arange(11)[::-1])
    J = read.by_biases(x, 12)
    shares = np.zeros((12, 2))
    shares[10] = (0.01, -0.02)
    shifts = (J @ shares.ravel()).reshape(11, 2)
    np.testing.assert_allclose(shifts[0], np.array([0.01, -0.02]) * 1500 * 6 / 30)
    np.testing.assert_array_equal(shifts[1:], 0.0)


def test_a_symmetric_pose_is_the_same_reading():
    x, eye = scene()
    half = np.diag([-1.0, -1.0, 1.0])
    turned = PoseEstimate(
        eye.R_cam_from_body(x) @ half, eye.origin_cam_m(x), np.eye(6), np.ones(11, bool), 1.0
    )
    np.testing.assert_allclose(Pose.of(eye, turned, half, 1.0).residual(x), 0.0, atol=1e-12)


def test_sigma_points_leave_nothing_of_a_linear_reading_and_see_the_curvature_of_another():
    class Curved:
        def residual(self, x):
            return x.dr_eci_m[..., :1] ** 2

        def jacobian(self, x):
            raise NotImplementedError

    class Straight(Curved):
        def residual(self, x):
            return 2.0 * x.dr_eci_m + x.dv_eci_m_s

    x, _ = scene()
    x = replace(x, dr_eci_m=np.array([3.0, 0.0, 0.0]))
    root = np.random.default_rng(0).standard_normal((12, 12)) * 0.1
    covariance = root @ root.T
    straight = SigmaPoints().reading(Straight(), x, covariance)
    np.testing.assert_allclose(straight.excess, 0.0, atol=1e-12)
    np.testing.assert_allclose(straight.jacobian[:, :6], np.c_[2 * np.eye(3), np.eye(3)], atol=1e-9)
    curved = SigmaPoints().reading(Curved(), x, covariance)
    np.testing.assert_allclose(curved.value, 9.0 + covariance[0, 0])
    np.testing.assert_allclose(curved.jacobian[0, 0], 6.0, atol=1e-9)
    assert curved.excess[0, 0] > 0


def test_errors_about_a_mean_are_moved_to_the_tangents_of_another():
    x, _ = scene()
    first = np.r_[np.zeros(6), 0.6, -0.3, 0.4, np.zeros(3)]
    step = 1e-6 * np.r_[np.zeros(6), 0.3, 0.9, -0.5, np.zeros(3)]
    moved = x.plus(first + step).minus(x.plus(first))
    np.testing.assert_allclose(moved, moved_tangent(first[6:9], 12) @ step, atol=1e-11)
