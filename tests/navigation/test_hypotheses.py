"""Ambiguous attitudes, outliers, losing the target and finding it again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rendezvous import World, errors

from posse_core import KeypointReading, NavigationProblem
from posse_core._detection.pnp import solve_pose
from posse_core._frames import unit
from posse_core._navigation.kalman import EkfNavigator, UkfNavigator
from posse_core._navigation.options import KalmanOptions

HALF = np.diag([-1.0, -1.0, 1.0])
FRAMES = 20
WORLD = World(t_s=np.arange(0.0, 10.0 * FRAMES, 10.0))
KINDS = [EkfNavigator, UkfNavigator]


def labels(mistaken: set[int]) -> np.ndarray:
    return np.array([HALF if k in mistaken else np.eye(3) for k in range(FRAMES)])


def run(readings, problem: NavigationProblem, world=WORLD, kind=EkfNavigator, options=None):
    """Errors (F, 12) after each frame, or NaN where there is no attitude, and the innovations."""
    navigator = kind(options or KalmanOptions())
    navigator.start(problem)
    found, innovations = [], []
    for state, read in zip(world.truth(), readings, strict=True):
        innovations.append(navigator.update(read))
        error = errors(state, navigator.estimate(state.t_s))
        found.append(np.r_[error, np.full(12 - len(error), np.nan)])
    return np.array(found), innovations


def turns_deg(found: np.ndarray) -> np.ndarray:
    return np.degrees(np.linalg.norm(found[:, 6:9], axis=1))


@pytest.mark.parametrize("kind", KINDS)
def test_a_symmetric_target_is_followed_though_each_frame_labels_it_at_random(kind):
    rng = np.random.default_rng(2)
    mistaken = set(np.flatnonzero(rng.uniform(size=FRAMES) < 0.5))
    problem = WORLD.problem(rng, symmetries=HALF[None])
    found, _ = run(WORLD.readings(rng, R_label=labels(mistaken)), problem, kind=kind)
    # Either of the equivalent attitudes is right, but it must be the same one throughout.
    turns = np.minimum(turns_deg(found), 180.0 - turns_deg(found))
    assert np.all(turns[5:] < 2.0)
    assert len({bool(turn > 90.0) for turn in turns_deg(found)}) == 1
    assert np.all(np.linalg.norm(found[5:, :3], axis=1) < 1.0)


@pytest.mark.parametrize("mistaken", [{8}, {8, 9}, {6, 10, 14}])
def test_a_few_mistaken_frames_change_nothing(mistaken):
    rng = np.random.default_rng(3)
    found, innovations = run(WORLD.readings(rng, R_label=labels(mistaken)), WORLD.problem(rng))
    assert np.all(turns_deg(found)[3:] < 3.0)
    for k in mistaken:
        assert innovations[k].rejected == innovations[k].dof == 22


def test_a_wrong_first_attitude_is_given_up():
    rng = np.random.default_rng(4)
    found, _ = run(WORLD.readings(rng, R_label=labels({0})), WORLD.problem(rng))
    assert turns_deg(found)[0] > 170.0
    assert np.all(turns_deg(found)[4:] < 3.0)


def test_single_wrong_keypoints_are_refused():
    rng = np.random.default_rng(5)
    readings = []
    for read in WORLD.readings(rng, poses=1):
        px = read.keypoints.points_px.copy()
        if read.index > 3:
            px[rng.choice(len(px), 2, replace=False)] += 60.0
        readings.append(replace(read, keypoints=replace(read.keypoints, points_px=px)))
    found, innovations = run(readings, WORLD.problem(rng))
    assert np.all(turns_deg(found)[4:] < 3.0)
    assert [i.rejected for i in innovations[5:]] == [4] * (FRAMES - 5)


@pytest.mark.parametrize("kind", KINDS)
def test_after_an_eclipse_the_target_is_found_again(kind):
    """Half an hour without readings: the position is still known, within its grown covariance."""
    t_s = np.r_[np.arange(0.0, 150.0, 10.0), np.arange(2000.0, 2100.0, 10.0)]
    world = World(t_s=t_s, rate_body_rad_s=(0.004, 0.02, -0.001))
    rng = np.random.default_rng(6)
    navigator = kind(KalmanOptions())
    navigator.start(world.problem(rng, inertia_kg_m2=None))
    truth, readings = world.truth(), world.readings(rng)
    for read in readings[:15]:
        navigator.update(read)
    before = navigator.estimate(140.0)
    late = navigator.estimate(1990.0)
    assert before.q_eci_from_body is not None
    assert late.q_eci_from_body is None, "a body of unknown inertia turns unseen"
    assert np.all(np.diag(late.covariance)[:3] > np.diag(before.covariance)[:3])
    error = errors(world.truth(np.array([1990.0]))[0], late)
    assert error @ np.linalg.solve(late.covariance, error) < 25.0
    for read in readings[15:]:
        navigator.update(read)
    error = errors(truth[-1], navigator.estimate(truth[-1].t_s))
    assert np.degrees(np.linalg.norm(error[6:9])) < 3.0
    assert np.linalg.norm(error[:3]) < 1.0


def test_a_wrong_position_is_given_up_after_many_refused_frames():
    """The navigator is told a start that is wrong by twenty standard deviations."""
    rng = np.random.default_rng(7)
    problem = WORLD.problem(rng)
    start = replace(problem.start, r_rtn_m=problem.start.r_rtn_m + np.array([20.0, 20.0, -20.0]))
    start = replace(start, covariance=np.diag(np.repeat([1.0, 0.01], 3) ** 2))
    found, _ = run(WORLD.readings(rng), replace(problem, start=start))
    assert np.isnan(found[2, 6])
    assert np.linalg.norm(found[-1, :3]) < 1.0
    assert turns_deg(found)[-1] < 3.0


def test_the_mirrored_attitude_of_a_flat_target_is_found_out():
    """Ten points near a plane, seen from afar: at first either lean fits, later only the true one."""
    rng = np.random.default_rng(8)
    flat = np.c_[rng.uniform(-2.0, 2.0, (10, 2)), rng.uniform(-0.05, 0.05, 10)]
    world = World(
        rtn=(30.0, -200.0, 40.0, 0.002, -0.01, 0.001),
        t_s=np.arange(0.0, 300.0, 10.0),
        rate_body_rad_s=(0.003, -0.004, 0.002),
        sigma_px=0.5,
    )
    camera = world.problem(rng).camera
    readings = []
    for view, read in zip(world.views, world.readings(rng), strict=True):
        px = camera.project(flat @ view.R_cam_from_body.T + view.origin_cam_m)
        px = px + 0.5 * rng.standard_normal(px.shape)
        sigma_px = np.full(len(px), 0.5)
        pose = solve_pose(flat, px, sigma_px, camera)
        if read.index == 0:
            # The first frame gives the mirrored pose.
            sight, normal = unit(view.origin_cam_m), np.array([0.0, 0.0, 1.0])
            mirror = [np.eye(3) - 2 * np.outer(n, n) for n in (sight, normal)]
            pose = replace(pose, R_cam_from_body=mirror[0] @ view.R_cam_from_body @ mirror[1])
        readings.append(replace(read, keypoints=KeypointReading(flat, px, sigma_px), pose=pose))
    found, _ = run(readings, world.problem(rng), world)
    assert turns_deg(found)[0] > 10.0
    assert np.all(turns_deg(found)[10:] < 5.0)


def test_a_fast_target_is_followed_by_the_turn_between_two_poses():
    """80° between frames, far beyond the rates that are expected before."""
    world = World(t_s=np.arange(0.0, 150.0, 10.0), rate_body_rad_s=(0.0, 0.0, 0.14))
    rng = np.random.default_rng(9)
    found, _ = run(world.readings(rng), world.problem(rng), world)
    assert np.all(turns_deg(found)[4:] < 3.0)
    assert np.linalg.norm(found[-1, 9:]) < 0.05 * 0.14
