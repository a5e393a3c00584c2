"""The trust of a pose: the probability that it is right."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest

from posse_core import Camera, PoseEstimate, pose

CAMERA = Camera(640, 480, 600.0, 600.0, 319.5, 239.5, 0.01)


def estimate(t, covariance):
    return PoseEstimate(np.eye(3), np.array(t), covariance, np.ones(8, np.bool_), 1.0)


@given(st.floats(-3, 0), st.integers(0, 2**31), st.booleans())
@settings(max_examples=30, deadline=None)
def test_it_is_the_share_of_drawn_errors_that_are_small(size, seed, is_needle):
    """Of a covariance of any shape, for attitude and position, each alone."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(3, 3)) * ([1.0, 0.1, 0.1] if is_needle else [1.0, 1.0, 1.0])
    covariance = A @ A.T * 10 ** (2 * size)
    drawn = np.linalg.norm(random.multivariate_normal(np.zeros(3), covariance, 20_000), axis=1)
    none = np.zeros((3, 3))
    of_attitude = estimate([0, 0, 5.0], np.block([[covariance, none], [none, none]])).trust
    assert of_attitude == pytest.approx(np.mean(drawn < np.radians(5)), abs=0.08)
    of_position = estimate([3.0, 0, 4.0], np.block([[none, none], [none, covariance]])).trust
    assert of_position == pytest.approx(np.mean(drawn < 0.05 * 5), abs=0.08)


def test_nothing_is_known_without_a_covariance():
    assert estimate([0, 0, 5.0], np.full((6, 6), np.inf)).trust == 0
    assert estimate([0, 0, 5.0], np.zeros((6, 6))).trust == 1


@given(st.floats(0, 1))
def test_a_pose_that_may_be_another_is_trusted_as_much_less(certainty):
    certain = estimate([0, 0, 5.0], np.eye(6) * 1e-3)
    assert certain.certainty == 1
    assert 0.01 < certain.trust < 0.99
    assert replace(certain, certainty=certainty).trust == pytest.approx(certainty * certain.trust)


def test_so_many_of_the_poses_from_noisy_points_are_right():
    """Points of a cube with normally distributed errors of many sizes, by what PnP makes of them."""
    random = np.random.default_rng(3)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.5, 0.5)])
    trusts, right = [], []
    for _ in range(300):
        R, t = Rotation.random(random_state=random), np.array([*random.uniform(-1, 1, 2), 12.0])
        sigma_px = np.exp(random.uniform(np.log(2), np.log(60)))
        seen = CAMERA.project(R.apply(corners) + t) + random.normal(0, sigma_px, (8, 2))
        found = pose(corners, seen, CAMERA, sigma_px)
        if found is not None:
            trusts.append(found.trust)
            off = (Rotation.from_matrix(found.R_cam_from_body) * R.inv()).magnitude()
            away = np.linalg.norm(found.t_body_cam_m - t) / np.linalg.norm(t)
            right.append(off < np.radians(5) and away < 0.05)
    assert len(trusts) > 250
    trust, is_right = np.array(trusts), np.array(right)
    for low, high in ((0, 0.3), (0.3, 0.7), (0.7, 1.01)):
        mine = (trust >= low) & (trust < high)
        share = binomtest(int(is_right[mine].sum()), int(mine.sum())).proportion_ci(0.999)
        assert share.low - 0.03 < trust[mine].mean() < share.high + 0.03, (low, mine.sum())
