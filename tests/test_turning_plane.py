"""Scenarios under J2: velocities in RTN, in ECI and in the camera's axes are those of one motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from posse_core._constants import Constants
from posse_core._files.trajectory import load_trajectory, save_trajectory
from posse_core._frames import matrix_from_quaternion
from posse_core._model.trajectory import PLANE_TURN, Trajectory
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._selection.collect import _joined
from posse_core._simulator.scene import scene_of
from posse_core._simulator.states import States
from posse_core._trajectory.build import make_trajectory
from posse_core._trajectory.state import frame_state

REGISTRY = load_plugins().registry
KEYS = {
    "propagator": {"name": "nonlinear", "gravity": "j2"},
    "relative": {"state_rtn": {"r_m": [900, -400, 800], "v_m_s": [0.1, -1.0, 0.5]}},
    "times": {"t_s": [1198.0, 1199.0, 1200.0, 1201.0, 1202.0]},
    "frames": None,
}


def trajectory(**more: object) -> Trajectory:
    return make_trajectory(load_scenario("aqua", REGISTRY, {**KEYS, **more}), REGISTRY)


def slope(x: np.ndarray) -> np.ndarray:
    """At the third of five values, a second apart."""
    return (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / 12


def test_velocities_are_the_slopes_of_positions_in_all_axes() -> None:
    made = trajectory()
    assert 1e-7 < abs(made.plane_turn_rad_s[2]) < 1.6e-6
    assert made.v_chaser_rtn_m_s[2] == pytest.approx(slope(made.r_chaser_rtn_m), abs=1e-7)
    apart_m = made.r_chaser_eci_m - made.r_target_eci_m
    apart_m_s = made.v_chaser_eci_m_s[2] - made.v_target_eci_m_s[2]
    assert apart_m_s == pytest.approx(slope(apart_m), abs=1e-6)
    R_eci_from_cam = matrix_from_quaternion(made.q_eci_from_camera[2])
    rates = frame_state(made, 2, Constants()).craft.rates
    assert R_eci_from_cam @ -rates.v_body_cam_m_s == pytest.approx(apart_m_s, abs=1e-9)


def test_a_recorded_trajectory_is_the_same_motion(tmp_path: Path) -> None:
    made = trajectory()
    save_trajectory(made, tmp_path / "t.npz")
    kept = load_trajectory(tmp_path / "t.npz")
    np.testing.assert_array_equal(kept.plane_turn_rad_s, made.plane_turn_rad_s)
    again = trajectory(propagator={"name": "file", "path": str(tmp_path / "t.npz")}, times=None)
    np.testing.assert_allclose(again.v_chaser_eci_m_s, made.v_chaser_eci_m_s, rtol=0, atol=1e-11)


def test_a_state_of_the_simulator_is_the_frames() -> None:
    """Of a frame by its number, at its time, and with its RTN state given."""
    scenario, made = load_scenario("aqua", REGISTRY, KEYS), trajectory()
    states = States(scenario, scene_of(scenario, REGISTRY), REGISTRY, made)
    attitude = "q_eci_from_body", "q_eci_from_camera", "omega_body_rad_s", "omega_camera_rad_s"
    nothing = dict.fromkeys(("t_s", "r_rtn_m", "v_rtn_m_s", *attitude))
    given = {"r_rtn_m": made.r_chaser_rtn_m[2], "v_rtn_m_s": made.v_chaser_rtn_m_s[2]}
    for asked in ({}, {"t_s": 1200.0}, given):
        row = states.row(2, **{**nothing, **asked})
        assert row.v_chaser_eci_m_s[0] == pytest.approx(made.v_chaser_eci_m_s[2], abs=1e-8)


def test_a_joined_trajectory_keeps_the_turn() -> None:
    """Where one of the two has no J2, its plane keeps still."""
    turning, still = trajectory(), trajectory(propagator="roe")
    both = _joined([still, turning])
    assert PLANE_TURN not in still.extras
    np.testing.assert_array_equal(both.plane_turn_rad_s[:5], 0)
    np.testing.assert_array_equal(both.plane_turn_rad_s[5:], turning.plane_turn_rad_s)
