"""Pose from keypoints: exact without noise; with it, as far off as its covariance says."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from posse_core._detection.pnp import solve_pose
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady, Fisheye

CAMERA = Camera(1280, 960, 2000.0, 2010.0, 640.0, 470.0, 0.01)


def scene(seed: int, points: int = 10, flat: bool = False):
    random = np.random.default_rng(seed)
    X = random.uniform(-2, 2, (points, 3))
    if flat:
        X[:, 2] = 0.3
    R = Rotation.random(random_state=random).as_matrix()
    t = np.array([*random.uniform(-2, 2, 2), random.uniform(12, 60)])
    return random, X, R, t, CAMERA.project(X @ R.T + t)


def turn_between(R, found) -> np.ndarray:
    return Rotation.from_matrix(found @ R.T).as_rotvec()


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_exact_points_give_the_exact_pose(seed, flat):
    _, X, R, t, uv = scene(seed, flat=flat)
    pose = solve_pose(X, uv, np.ones(len(X)), CAMERA)
    assert pose is not None
    reprojected = CAMERA.project(X @ pose.R_cam_from_body.T + pose.t_body_cam_m)
    np.testing.assert_allclose(reprojected, uv, atol=1e-3)
    if not flat:  # a plane seen from afar has a twin pose within rounding
        np.testing.assert_allclose(turn_between(R, pose.R_cam_from_body), 0, atol=1e-4)
        np.testing.assert_allclose(pose.t_body_cam_m, t, rtol=1e-4, atol=1e-3)


LENS = dataclasses.replace(CAMERA, distortion=BrownConrady(-0.4, 0.3, 0.002, -0.003, 0.1))


FISHEYE = Camera(1280, 960, 640.0, 645.0, 640.0, 470.0, 0.01, distortion=Fisheye(-0.02, 0.01, 0, 0))


@given(st.integers(0, 2**32 - 1))
def test_exact_points_through_a_lens_give_the_exact_pose(seed):
    _, X, R, t, _ = scene(seed)
    points, k = X @ R.T + t, LENS.distortion_coefficients
    uv = cv2.projectPoints(points, np.zeros(3), np.zeros(3), LENS.matrix, k)[0][:, 0]
    pose = solve_pose(X, uv, np.ones(len(X)), LENS)
    assert pose is not None
    np.testing.assert_allclose(turn_between(R, pose.R_cam_from_body), 0, atol=1e-4)
    np.testing.assert_allclose(pose.t_body_cam_m, t, rtol=1e-4, atol=1e-3)


@given(st.integers(0, 2**32 - 1), st.floats(0, 1.2), st.floats(0, 6.28))
def test_exact_points_far_off_a_fisheyes_axis_give_the_exact_pose(seed, off, turn):
    _, X, R, t, _ = scene(seed)
    away = Rotation.from_rotvec([off * np.cos(turn), off * np.sin(turn), 0]).as_matrix()
    R, t = away @ R, 0.5 * away @ t
    points, k = X @ R.T + t, FISHEYE.distortion_coefficients
    assume((np.hypot(*(points[:, :2] / points[:, 2:]).T) < 0.9 * FISHEYE.distortion.reach).all())
    assume((points[:, 2] > 0).all())
    uv = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), FISHEYE.matrix, k)[0]
    pose = solve_pose(X, uv[:, 0], np.ones(len(X)), FISHEYE)
    assert pose is not None
    np.testing.assert_allclose(turn_between(R, pose.R_cam_from_body), 0, atol=1e-4)
    np.testing.assert_allclose(pose.t_body_cam_m, t, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(
    ("camera", "trials"), [(CAMERA, 150), (LENS, 40), (FISHEYE, 40)], ids=["pinhole", "lens", "fisheye"]
)
def test_errors_follow_the_covariance(camera, trials):
    squared = []
    for seed in range(trials):
        random, X, R, t, _ = scene(seed, points=14)
        uv = camera.project(X @ R.T + t)
        sigma = random.uniform(0.3, 2.0, len(X))
        pose = solve_pose(X, uv + sigma[:, None] * random.normal(size=uv.shape), sigma, camera)
        assert pose is not None
        error = np.concatenate([turn_between(R, pose.R_cam_from_body), pose.t_body_cam_m - t])
        squared.append(error @ np.linalg.solve(pose.covariance, error))
    # A sum of squares of independent normal variables; Huber's weights cost some 5 % of efficiency.
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * trials)
    assert low < sum(squared) < 1.2 * high


def test_outliers_are_left_out():
    for seed in range(20):
        random, X, R, t, uv = scene(seed, points=12)
        noisy = uv + 0.3 * random.normal(size=uv.shape)
        noisy[:3] += random.uniform(100, 300, (3, 2))
        pose = solve_pose(X, noisy, np.full(len(X), 0.3), CAMERA)
        assert pose is not None
        assert not pose.inliers[:3].any()
        assert np.linalg.norm(pose.t_body_cam_m - t) < 0.05 * np.linalg.norm(t)
        assert np.linalg.norm(turn_between(R, pose.R_cam_from_body)) < 0.06


def test_the_surer_points_count():
    better = 0
    for seed in range(30):
        random, X, R, _, uv = scene(seed, points=12)
        sigma = np.where(np.arange(12) < 6, 0.1, 5.0)
        noisy = uv + sigma[:, None] * random.normal(size=uv.shape)
        weighted = solve_pose(X, noisy, sigma, CAMERA)
        even = solve_pose(X, noisy, np.full(12, 5.0), CAMERA)
        assert weighted is not None
        assert even is not None
        errors = [np.linalg.norm(turn_between(R, p.R_cam_from_body)) for p in (weighted, even)]
        better += errors[0] < errors[1]
    assert better >= 25


def test_too_little_gives_no_pose():
    random, X, *_, uv = scene(1)
    assert solve_pose(X[:3], uv[:3], np.ones(3), CAMERA) is None
    nonsense = random.uniform(0, 900, uv.shape)
    pose = solve_pose(X, nonsense, np.full(len(X), 0.01), CAMERA)
    assert pose is None or pose.inliers.sum() >= 4


def test_the_same_points_give_the_same_pose():
    random, X, *_, uv = scene(3)
    noisy = uv + random.normal(size=uv.shape)
    poses = [solve_pose(X, noisy, np.ones(len(X)), CAMERA) for _ in range(2)]
    assert poses[0] is not None
    assert poses[1] is not None
    assert poses[0].t_body_cam_m == pytest.approx(poses[1].t_body_cam_m, abs=0)
