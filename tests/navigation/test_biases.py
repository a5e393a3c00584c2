"""How the slow parts of keypoints' errors are kept from frame to frame, and noise that is learnt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rendezvous import POINTS_M, World, errors

from posse_core._frames import matrix_from_rotation_vector
from posse_core._navigation import biases
from posse_core._navigation.belief import Belief, Propagation
from posse_core._navigation.kalman import EkfNavigator
from posse_core._navigation.kinematics import SIZE
from posse_core._navigation.options import KalmanOptions

OPTIONS = KalmanOptions(bias_share=0.01, bias_time_s=100.0, bias_angle_deg=10.0, bias_zoom=1.5)


def believed() -> Belief:
    """A belief with biases of the first six keypoints, learnt to be other than zero."""
    problem = World().problem(np.random.default_rng(0))
    first = Propagation(problem, OPTIONS).belief(problem.start)
    belief, slots = biases.renewed(first, POINTS_M[:6], np.eye(3), OPTIONS)
    np.testing.assert_array_equal(slots, np.arange(6))
    covariance = belief.covariance.copy()
    covariance[SIZE:, SIZE:] *= 0.25
    covariance[0, SIZE] = covariance[SIZE, 0] = 1e-3
    shares = np.linspace(-0.02, 0.02, 12)
    return replace(belief, covariance=covariance, biases=replace(belief.biases, shares=shares))


@pytest.mark.parametrize(
    ("later_s", "turn_rad", "nearer", "exponent"),
    [
        (0.0, 0.0, 1.0, 0.0),
        (50.0, 0.0, 1.0, 0.5),
        (0.0, np.radians(5.0), 1.0, 0.5),
        (0.0, 0.0, 1.5, 1.0),
        (0.0, 0.0, 1 / 1.5, 1.0),
        (100.0, np.radians(10.0), 1.5, 3.0),
    ],
)
def test_what_is_kept_falls_with_time_turn_and_zoom(later_s, turn_rad, nearer, exponent):
    before = believed()
    at = replace(before.at, t_s=before.at.t_s + later_s)
    x = replace(before.x, dr_eci_m=before.x.dr_eci_m / nearer)
    view = matrix_from_rotation_vector(np.array([0.0, turn_rad, 0.0]))
    after, _ = biases.renewed(replace(before, at=at, x=x), POINTS_M[:6], view, OPTIONS)
    kept = np.exp(-exponent)
    np.testing.assert_allclose(after.biases.shares, kept * before.biases.shares)
    variance = 0.25 * 1e-4 * kept**2 + 1e-4 * (1 - kept**2)
    np.testing.assert_allclose(np.diag(after.covariance)[SIZE:], variance)
    np.testing.assert_allclose(after.covariance[0, SIZE], kept * 1e-3)
    np.testing.assert_array_equal(after.covariance[:SIZE, :SIZE], before.covariance[:SIZE, :SIZE])


def test_each_keypoint_keeps_its_own_bias_in_any_order():
    before = believed()
    chosen = POINTS_M[[8, 3, 0, 9]]
    after, slots = biases.renewed(before, chosen, np.eye(3), OPTIONS)
    np.testing.assert_array_equal(slots, [6, 3, 0, 7])
    np.testing.assert_array_equal(after.biases.points_body_m[slots], chosen)
    np.testing.assert_array_equal(after.biases.shares[:12], before.biases.shares)
    np.testing.assert_array_equal(after.biases.shares[12:], 0.0)
    np.testing.assert_allclose(np.diag(after.covariance)[SIZE + 12 :], 1e-4)
    np.testing.assert_array_equal(after.covariance[SIZE + 12 :, : SIZE + 12], 0.0)


def test_turns_that_the_motion_does_not_know_are_followed_by_learnt_process_noise():
    """A tumbling target that the filter takes to spin steadily."""
    world = World(t_s=np.arange(0.0, 400.0, 10.0), rate_body_rad_s=(0.003, 0.010, -0.005))
    turns = {}
    for adaptive in (True, False):
        rng = np.random.default_rng(0)
        navigator = EkfNavigator(KalmanOptions(tumbling_share=0.0, adaptive=adaptive))
        navigator.start(world.problem(rng, inertia_kg_m2=None))
        found = []
        for state, readings in zip(world.truth(), world.readings(rng), strict=True):
            navigator.update(readings)
            found.append(errors(state, navigator.estimate(state.t_s))[6:9])
        turns[adaptive] = np.degrees(np.median(np.linalg.norm(found[20:], axis=1)))
    assert turns[True] < 0.7 * turns[False]
