"""Bodies beside the target: their motion and attitude by the scenario's models, against scenarios of
which each is the target or the chaser."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core._errors import InputError
from posse_core._frames import matrix_from_quaternion, rtn_from_eci
from posse_core._model.scene import FrameState
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.states import States

REGISTRY = load_plugins().registry
ROE_M = [0.0, 30.0, 5.0, 0.0, 8.0, 0.0]
TRACK = {"attitude": {"camera": {"law": "track"}, "target": {"law": "nadir"}}}


def states(overrides: Mapping[str, Any], propagator: str = "roe") -> States:
    given = {**TRACK, "propagator": propagator, "times": {"t_s": [0.0, 700.0, 1900.0]}, **overrides}
    scenario = load_scenario("aqua", REGISTRY, given)
    return States(scenario, scene_of(scenario, REGISTRY), REGISTRY, None)


def body(**keys: Any) -> dict[str, Any]:
    return {"bodies": {"friend": {"spacecraft": {"name": "cubesat"}, **keys}}}


def r_body_rtn_m(state: FrameState, number: int = 0) -> np.ndarray:
    """The body's position from the target in the target's RTN axes, from the state alone."""
    between_cam_m = state.craft.others[number].t_body_cam_m - state.craft.t_body_cam_m
    r = state.r_target_eci_m
    return state.R_cam_from_eci.T @ between_cam_m, r


@pytest.mark.parametrize("propagator", ["roe", "yamanaka-ankersen", "nonlinear"])
def test_a_body_flies_as_a_chaser_with_its_elements_would(propagator):
    """Its place in every frame is the chaser's of the scenario whose chaser has its elements."""
    with_body = states(body(relative={"roe_m": ROE_M}), propagator)
    as_chaser = states({"relative": {"roe_m": ROE_M}}, propagator)
    for index in range(3):
        state, other = with_body.own(index), as_chaser.own(index)
        mine, _ = r_body_rtn_m(state)
        theirs = other.R_cam_from_eci.T @ -other.craft.t_body_cam_m
        np.testing.assert_allclose(mine, theirs, atol=1e-6)
        rates, target = state.craft.others[0].rates, state.craft.rates
        v = state.R_cam_from_eci.T @ (rates.v_body_cam_m_s - target.v_body_cam_m_s)
        v_other = other.R_cam_from_eci.T @ -other.craft.rates.v_body_cam_m_s
        np.testing.assert_allclose(v, v_other, atol=1e-9)


def test_a_body_without_distance_from_the_target_is_the_target():
    still = {"design": {"name": "hold-point", "r_rtn_m": [0.0, 0.0, 0.0]}}
    for law in ("nadir", {"law": "spin", "rate_rpm": 2.0, "sun_angle_deg": 60.0}):
        attitude = {"attitude": {"camera": {"law": "track"}, "target": law}}
        state = states({**body(relative=still, attitude=law), **attitude}).own(1)
        other = state.craft.others[0]
        np.testing.assert_allclose(other.R_cam_from_body, state.craft.R_cam_from_body, atol=1e-12)
        np.testing.assert_allclose(other.t_body_cam_m, state.craft.t_body_cam_m, atol=1e-9)
        for name in ("v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s"):
            mine, theirs = getattr(other.rates, name), getattr(state.craft.rates, name)
            np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_the_rates_of_a_body_are_those_of_its_motion():
    """Against the difference of its poses at two neighbouring times."""
    spin = {"law": "spin", "rate_rpm": 3.0, "sun_angle_deg": 40.0}
    flown = states(body(relative={"roe_m": ROE_M}, attitude=spin))
    state = flown.onward(1, flown.own(1), own_frame=True)
    before, after = state.onward.at(-0.05), state.onward.at(0.05)
    x = np.array([[0.3, -0.2, 0.1], [0.0, 0.0, 0.0]])
    moved = [s.R_cam_from_eci.T @ s.craft.others[0].in_camera(x, np.zeros(2)).T for s in (before, after)]
    by_rates = [
        state.R_cam_from_eci.T
        @ (matrix_of_turn(state, t_s) @ state.craft.others[0].in_camera(x, np.full(2, t_s)).T)
        for t_s in (-0.05, 0.05)
    ]
    np.testing.assert_allclose(by_rates, moved, atol=3e-5)


def matrix_of_turn(state: FrameState, after_s: float) -> np.ndarray:
    """From the camera's axes after a time to those at the frame's instant."""
    return Rotation.from_rotvec(state.craft.rates.omega_camera_rad_s * after_s).as_matrix()


def test_a_carried_body_is_where_its_mount_says():
    mount = {"position_m": [0.1, 0.3, 0.5], "rotation_vector_deg": [0.0, 0.0, 90.0]}
    made = states(body(mount=mount))
    for index in range(3):
        other = made.own(index).craft.others[0]
        assert other.is_carried
        np.testing.assert_array_equal(other.t_body_cam_m, [0.1, 0.3, 0.5])
        turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
        np.testing.assert_allclose(other.R_cam_from_body, turn, atol=1e-15)
        moved = replace(other, is_carried=False).in_camera(np.eye(3), np.full(3, 1e-3))
        np.testing.assert_allclose(moved, turn.T + other.t_body_cam_m, atol=1e-10)  # also by its rates


def test_fragments_are_spread_turned_and_numbered():
    keys = {"relative": {"roe_m": ROE_M}, "count": 60, "spread_m": [3.0, 0.0, 1.0]}
    fragments = {**body(**keys)["bodies"]["friend"], "attitude": {"law": "inertial"}}
    made = states({"bodies": {"friend": fragments}, "times": {"t_s": [0.0]}})
    scenario = made._scenario
    names = [each.name for each in scene_of(scenario, REGISTRY).others]
    assert names == [f"friend-{k}" for k in range(1, 61)]
    state = made.own(0)
    row = made.trajectory.rows(np.array([0]))
    R_eci_from_cam = matrix_from_quaternion(row.q_eci_from_camera[0])
    offsets = np.array([R_eci_from_cam @ each.t_body_cam_m for each in state.craft.others])
    there = row.r_chaser_eci_m[0] + offsets
    rtn, _ = rtn_from_eci(
        np.tile(row.r_target_eci_m, (60, 1)),
        np.tile(row.v_target_eci_m_s, (60, 1)),
        there,
        np.zeros_like(there),
    )
    spread = rtn.std(axis=0)
    np.testing.assert_array_less(spread, [3.9, 1e-6, 1.4])
    np.testing.assert_array_less([2.2, -1.0, 0.7], spread)
    turns = np.array([each.R_cam_from_body for each in state.craft.others])
    assert np.linalg.norm(turns.mean(axis=0)) < 0.5  # of rotations spread over all directions
    again = states({"bodies": {"friend": fragments}, "times": {"t_s": [0.0]}}).own(0)
    np.testing.assert_array_equal([each.R_cam_from_body for each in again.craft.others], turns)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "give exactly one of relative, mount"),
        ({"relative": {"roe_m": ROE_M}, "mount": {}}, "give exactly one of relative, mount"),
        ({"mount": {}, "attitude": "tumbling"}, "attitude: not with mount"),
        ({"relative": {"roe_m": ROE_M}, "attitude": "track"}, "not made for the target"),
        ({"relative": {"roe_m": ROE_M}, "count": 300}, "less than or equal to 200"),
        ({"relative": {"roe_m": ROE_M}, "spread_m": [-1, 0, 0]}, "standard deviations"),
        ({"relative": {"roe_m": ROE_M}, "propagator": "sgp5"}, "sgp5"),
    ],
)
def test_keys_that_cannot_be_are_named(keys, message):
    with pytest.raises(InputError, match=r"bodies\.friend") as error:
        states(body(**keys))
    assert message in str(error.value)


def test_names_of_bodies_differ():
    each = {"spacecraft": {"name": "cubesat"}, "relative": {"roe_m": ROE_M}}
    with pytest.raises(InputError, match="two bodies are named 'a-1'"):
        states({"bodies": {"a": {**each, "count": 2}, "a-1": each}})


def test_a_body_of_several_relative_orbits_is_refused():
    design = {"name": "algorithm-3-1-repaired", "size_m": 30.0}
    with pytest.raises(InputError, match=r"bodies\.friend\.relative"):
        states(body(relative={"design": design})).own(0)


def test_the_joints_of_bodies_have_laws_of_their_own():
    joints = {
        "shoulder": {"law": "fixed", "value_deg": 40.0},
        "finger_left": {"law": "rate", "rate_m_s": 1e-5},
    }
    arm = {"spacecraft": {"name": "arm"}, "mount": {"position_m": [0, 0, 1]}, "joints": joints}
    free = {"spacecraft": {"name": "arm"}, "relative": {"roe_m": ROE_M}, "joints": {"elbow": "random"}}
    made = states({"bodies": {"arm": arm, "pair": {**free, "count": 2}}})
    carried, one, two = made.own(2).craft.others
    assert [joint.name for joint in carried.articulation.joints] == ["shoulder", "finger_left"]
    np.testing.assert_allclose(carried.articulation.values, [np.radians(40.0), 1900e-5])
    np.testing.assert_allclose(carried.articulation.rates, [0.0, 1e-5], atol=1e-12)
    assert one.articulation.values != two.articulation.values
    with pytest.raises(InputError, match=r"bodies\.arm\.joints\.elbo: .* did you mean 'elbow'"):
        states({"bodies": {"arm": {**arm, "joints": {"elbo": "random"}}}})


def test_a_wing_of_a_body_turns_to_the_sun():
    """The body at the target's place with its attitude has the target's joint."""
    still = {"design": {"name": "hold-point", "r_rtn_m": [0.0, 0.0, 0.0]}}
    keys = {"spacecraft": {"name": "aqua"}, "relative": still, "joints": {"wing": "sun-tracking"}}
    made = states({"bodies": {"twin": keys}, "joints": {"wing": "sun-tracking"}})
    for index in range(3):
        craft = made.own(index).craft
        np.testing.assert_allclose(
            craft.others[0].articulation.values, craft.articulation.values, atol=1e-9
        )
