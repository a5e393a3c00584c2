"""Poses from keypoints that may each be at several places: all poses that fit, the likeliest first."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import posse_core as posse
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady

CAMERA = Camera(1280, 960, 2000.0, 2010.0, 640.0, 470.0, 0.01)
LENS = dataclasses.replace(CAMERA, distortion=BrownConrady(-0.4, 0.3, 0.002, -0.003, 0.1))
SEEDS = st.integers(0, 2**32 - 1)


def a_pose(random, near=None):
    """An attitude and a position; with ``near``, half a turn about an axis from it."""
    if near is None:
        t = np.array([*random.uniform(-2, 2, 2), random.uniform(12, 40)])
        return Rotation.random(random_state=random).as_matrix(), t
    axis = random.normal(size=3)
    flip = Rotation.from_rotvec(np.pi * axis / np.linalg.norm(axis)).as_matrix()
    return near[0] @ flip, near[1] + random.normal(0, 0.05, 3)


def seen_two_ways(seed, count):
    """Random numbers, keypoints (count, 3), and two poses that are half a turn apart."""
    random = np.random.default_rng(seed)
    X = random.uniform(-2, 2, (count, 3))
    one = a_pose(random)
    return random, X, one, a_pose(random, near=one)


def places_of(X, poses, shares, camera, sigma_px=1.0, noise=None):
    """Each keypoint at its projections by all poses, the likeliest first."""
    px = np.stack([camera.project(X @ R.T + t) for R, t in poses], axis=1)
    if noise is not None:
        px = px + sigma_px * noise.normal(size=px.shape)
    order = np.argsort(-shares, axis=1)
    share = np.take_along_axis(shares, order, axis=1)
    px = np.take_along_axis(px, order[..., None], axis=1)
    return posse.KeypointPlaces(px, np.full(share.shape, sigma_px), share)


def found(places):
    return posse.Detection("brick", 0.9, np.array([0.0, 0, 10, 10])).with_places(places)


def is_pose(estimate, pose, within=1e-3):
    turn = Rotation.from_matrix(estimate.R_cam_from_body @ pose[0].T).magnitude()
    away = np.linalg.norm(estimate.t_body_cam_m - pose[1]) / np.linalg.norm(pose[1])
    return turn < within and away < within


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
@given(SEEDS)
def test_keypoints_that_are_each_at_one_of_two_places_give_both_poses(camera, seed):
    """Which place is likelier is random for each keypoint, so that the likeliest ones fit no pose."""
    random, X, one, other = seen_two_ways(seed, 12)
    first = random.permutation(12) < 6
    shares = np.where(first[:, None], [0.6, 0.35], [0.35, 0.6])
    poses = posse.poses(X, found(places_of(X, [one, other], shares, camera)), camera)
    assert sum(pose.certainty for pose in poses) == pytest.approx(1)
    assert [pose.certainty for pose in poses] == sorted((p.certainty for p in poses), reverse=True)
    for pose in (one, other):
        assert any(is_pose(estimate, pose) for estimate in poses[:2])


@given(SEEDS)
def test_the_pose_whose_places_are_likelier_comes_first(seed):
    _, X, one, other = seen_two_ways(seed, 10)
    shares = np.tile([0.2, 0.7], (10, 1))
    poses = posse.poses(X, found(places_of(X, [one, other], shares, CAMERA)), CAMERA)
    assert is_pose(poses[0], other)
    assert poses[0].certainty > 0.5


@given(SEEDS)
def test_the_keypoints_of_a_pose_are_at_the_places_that_fit_it(seed):
    _, X, one, other = seen_two_ways(seed, 10)
    shares = np.tile([0.5, 0.4], (10, 1))
    for estimate in posse.poses(X, found(places_of(X, [one, other], shares, CAMERA)), CAMERA)[:2]:
        projected = CAMERA.project(X @ estimate.R_cam_from_body.T + estimate.t_body_cam_m)
        fit = np.linalg.norm(estimate.detection.keypoints_px - projected, axis=1)
        assert (fit[estimate.inliers] < 5.0).all()
        assert estimate.inliers.sum() >= 4


def test_errors_follow_the_covariance():
    squared = []
    for seed in range(100):
        random, X, one, other = seen_two_ways(seed, 14)
        shares = np.tile([0.6, 0.3], (14, 1))
        places = places_of(X, [one, other], shares, CAMERA, sigma_px=1.5, noise=random)
        estimate = posse.poses(X, found(places), CAMERA)[0]
        turn = Rotation.from_matrix(estimate.R_cam_from_body @ one[0].T).as_rotvec()
        error = np.concatenate([turn, estimate.t_body_cam_m - one[1]])
        squared.append(error @ np.linalg.solve(estimate.covariance, error))
    # A sum of squares of independent normal variables; Huber's weights cost some 5 % of efficiency.
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * 100)
    assert low < sum(squared) < 1.2 * high


def test_keypoints_anywhere_make_a_pose_no_likelier_than_it_is():
    """A third of the keypoints are at none of their places, and one has no place on the body."""
    random = np.random.default_rng(5)
    X = random.uniform(-2, 2, (12, 3))
    one = a_pose(random)
    places = places_of(X, [one], np.full((12, 1), 0.9), CAMERA)
    wrong = places.points_px.copy()
    wrong[:4] += random.uniform(100, 200, (4, 1, 2))
    X[11] = np.nan
    told = found(dataclasses.replace(places, points_px=wrong))
    estimate = posse.poses(X, told, CAMERA)[0]
    assert is_pose(estimate, one)
    assert not estimate.inliers[:4].any()
    assert not estimate.inliers[11]


def test_too_few_keypoints_give_no_pose_and_wrong_shapes_one_line():
    random = np.random.default_rng(1)
    X = random.uniform(-2, 2, (5, 3))
    shares = np.full((5, 1), 0.9)
    shares[:2] = 0
    places = places_of(X, [a_pose(random)], shares, CAMERA)
    assert posse.poses(X, found(places), CAMERA) == []
    with pytest.raises(posse.InputError, match=r"points_body_m is \(4, 3\).* 5 keypoints"):
        posse.poses(X[:4], found(places), CAMERA)
    with pytest.raises(posse.InputError, match="no keypoints"):
        posse.poses(X, posse.Detection("brick", 0.9, np.zeros(4)), CAMERA)


def test_the_same_places_give_the_same_poses():
    random, X, one, other = seen_two_ways(2, 12)
    shares = np.tile([0.5, 0.4], (12, 1))
    told = found(places_of(X, [one, other], shares, CAMERA, 1.0, random))
    first, again = (posse.poses(X, told, CAMERA) for _ in range(2))
    assert [pose.t_body_cam_m.tolist() for pose in first] == [p.t_body_cam_m.tolist() for p in again]
