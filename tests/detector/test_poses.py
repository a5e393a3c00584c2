"""Metrics of poses against SciPy, closed forms and vectors worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

from posse_core._evaluation.poses import (
    add_m,
    adi_m,
    nees,
    pose_errors,
    speed_score,
)
from posse_core._frames import matrix_from_quaternion


@given(st.integers(0, 2**32 - 1), st.floats(0, np.pi), st.floats(0, 2))
def test_speed_errors_are_the_angle_and_the_relative_distance(seed, angle, share):
    random = np.random.default_rng(seed)
    attitude = Rotation.random(random_state=random)
    axis = random.normal(size=3)
    other = attitude * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    t, away = random.normal((0, 0, 10), 1), random.normal(size=3)
    found = t + share * np.linalg.norm(t) * away / np.linalg.norm(away)
    q, q_other = (np.roll(r.as_quat(), 1) for r in (attitude, other))
    R, R_other, R_same = (matrix_from_quaternion(x) for x in (q, q_other, -q_other))
    e_t, e_q = pose_errors(R, t, R_other, found)
    assert e_t == pytest.approx(share, abs=1e-9)
    assert e_q == pytest.approx(angle, abs=1e-7)
    assert e_q == pytest.approx(2 * np.arccos(min(abs(q @ q_other), 1)), abs=1e-6)
    assert pose_errors(R, t, R_same, found)[1] == pytest.approx(e_q, abs=1e-9)


def test_poses_drawn_by_their_covariance_have_chi_squared_errors():
    """Also where a symmetry of the body turned them: the nearest counts."""
    random = np.random.default_rng(0)
    root = random.normal(size=(6, 6)) * np.array([0.01, 0.02, 0.005, 0.1, 0.05, 1.0])[:, None]
    half_turn = np.diag([-1.0, -1.0, 1.0])
    R, t = Rotation.random(rng=random).as_matrix(), np.array([1.0, -2.0, 30.0])
    found = []
    for k in range(4000):
        error = root @ random.normal(size=6)
        R_found = Rotation.from_rotvec(error[:3]).as_matrix() @ R @ (half_turn if k % 2 else np.eye(3))
        found.append(nees(R, t, R_found, t + error[3:], root @ root.T, [half_turn]))
    # Kolmogorov and Smirnov's test would err in one seed of a thousand.
    assert kstest(found, chi2(6).cdf).pvalue > 1e-3


def test_a_symmetry_costs_nothing():
    turn = np.diag([1.0, -1.0, -1.0])
    R = Rotation.random(random_state=1).as_matrix()
    t = np.array([0.0, 0, 5])
    assert pose_errors(R, t, R @ turn, t)[1] == pytest.approx(np.pi)
    assert pose_errors(R, t, R @ turn, t, [turn])[1] == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize(
    ("version", "expected"),
    [
        # poses: both fine; only e_t fine; only e_q fine; none fine
        ("2019", [0.002 + np.deg2rad(0.1), 0.002 + np.deg2rad(1), 0.01 + np.deg2rad(0.1), 0.5 + np.pi]),
        ("2021", [0.0, 0.002 + np.deg2rad(1), 0.01 + np.deg2rad(0.1), 0.5 + np.pi]),
        ("2023", [0.0, np.deg2rad(1), 0.01, 0.5 + np.pi]),
    ],
)
def test_the_three_speed_scores(version, expected):
    e_t = np.array([0.002, 0.002, 0.01, 0.5])
    e_q = np.array([np.deg2rad(0.1), np.deg2rad(1), np.deg2rad(0.1), np.pi])
    for place, value in enumerate(expected):
        assert speed_score(e_t[place : place + 1], e_q[place : place + 1], version) == pytest.approx(
            value
        )
    assert speed_score(e_t, e_q, version) == pytest.approx(np.mean(expected))


SQUARE = np.array([[1.0, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
T = np.array([0.3, -0.2, 12.0])
NONE = np.eye(3)


def about_z(degrees):
    return Rotation.from_euler("z", degrees, degrees=True).as_matrix()


@pytest.mark.parametrize(
    ("R_found", "t_found", "add", "adi"),
    [
        (NONE, T, 0.0, 0.0),
        (NONE, T + np.array([0.3, 0.4, 0.0]), 0.5, 0.5),  # all points alike; each stays nearest
        (about_z(90), T, 2.0, 0.0),  # each corner goes to the next: a side is 2
        (about_z(180), T, 2 * np.sqrt(2), 0.0),  # to the opposite one: the diagonal
        (about_z(60), T, np.sqrt(2), 2 * np.sqrt(2) * np.sin(np.deg2rad(15))),  # chords of 60 and 30 deg
        (
            NONE,
            T + np.array([2.0, 0, 0]),
            2.0,
            1.0,
        ),  # two corners find the other two, which were two away
    ],
)
def test_add_and_adi_of_a_square(R_found, t_found, add, adi):
    assert add_m(SQUARE, NONE, T, R_found, t_found) == pytest.approx(add, abs=1e-12)
    assert adi_m(SQUARE, NONE, T, R_found, t_found) == pytest.approx(adi, abs=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
def test_add_and_adi_are_their_definitions(seed, count):
    """Hinterstoisser et al. 2012, eq. 3 and 4, with all pairs of points."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    points = np.concatenate([points, points[: count // 3]])  # vertices that coincide count as often
    R, R_found = Rotation.random(2, random_state=random).as_matrix()
    t, t_found = random.normal((0, 0, 8), 1, (2, 3))
    there, found = points @ R.T + t, points @ R_found.T + t_found
    pairs = cdist(there, found)
    assert add_m(points, R, t, R_found, t_found) == pytest.approx(np.diag(pairs).mean())
    assert adi_m(points, R, t, R_found, t_found) == pytest.approx(pairs.min(axis=1).mean())
