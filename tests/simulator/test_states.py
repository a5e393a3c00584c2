"""States by index, by time and by the caller, against SciPy's rotations and the scenario's motion."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core import InputError
from posse_core._files.tables import write_table
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.states import States
from posse_core._trajectory.build import make_trajectory

REGISTRY = load_plugins().registry
NOTHING = dict.fromkeys(
    (
        "t_s",
        "r_rtn_m",
        "v_rtn_m_s",
        "q_eci_from_body",
        "q_eci_from_camera",
        "omega_body_rad_s",
        "omega_camera_rad_s",
    )
)


def states(**overrides: object) -> States:
    """Of the scenario ``aqua``, its camera looking straight at the target."""
    steady = {"times.count": 5, "attitude.camera": {"law": "track", "offset": 0.0}}
    return states_of(load_scenario("aqua", REGISTRY, {**steady, **overrides}))


def states_of(scenario: Scenario) -> States:
    return States(scenario, scene_of(scenario, REGISTRY), REGISTRY, None)


AQUA = states()


def at(index: int = 0, of: States = AQUA, **given: object):
    return of.of_row(of.row(index, **{**NOTHING, **given}), index)


def scipy_from(q) -> Rotation:
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


@given(st.floats(1e-30, 6000) | st.just(0.0), st.integers(0, 10**6))
def test_at_any_time_the_motion_is_the_scenarios(t_s: float, index: int) -> None:
    """Against a trajectory that has a frame at that time."""
    scenario = load_scenario("aqua", REGISTRY, {"times": {"t_s": [t_s]}})
    trajectory = make_trajectory(scenario, REGISTRY)
    state = at(index, t_s=t_s)
    assert (state.index, state.t_s) == (index, t_s)
    np.testing.assert_array_equal(state.r_target_eci_m, trajectory.r_target_eci_m[0])
    np.testing.assert_array_equal(state.r_camera_eci_m, trajectory.r_chaser_eci_m[0])
    assert state.sun_fraction_target == trajectory.sun_fraction_target[0]
    assert state.craft.range_m == pytest.approx(np.linalg.norm(trajectory.r_chaser_rtn_m[0]), abs=1e-9)


@given(st.lists(st.floats(-60, 60), min_size=3, max_size=3).filter(lambda r: np.linalg.norm(r) > 1))
def test_a_given_position_is_where_the_camera_is(r_rtn_m: list[float]) -> None:
    """The camera looks at the target, whose R, T and N are by two cross products."""
    state = at(2, r_rtn_m=r_rtn_m)
    trajectory = AQUA.trajectory
    r, v = trajectory.r_target_eci_m[2], trajectory.v_target_eci_m_s[2]
    radial, normal = r / np.linalg.norm(r), np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    axes = np.stack([radial, np.cross(normal, radial), normal])
    np.testing.assert_allclose(
        state.craft.t_body_cam_m, -state.R_cam_from_eci @ axes.T @ r_rtn_m, atol=1e-9
    )
    np.testing.assert_allclose(state.craft.t_body_cam_m[:2], 0, atol=1e-6)
    assert state.craft.t_body_cam_m[2] == pytest.approx(np.linalg.norm(r_rtn_m), abs=1e-9)


quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
    lambda q: np.linalg.norm(q) > 0.1
)


@given(quaternions, quaternions)
def test_given_attitudes_are_taken(body: list[float], camera: list[float]) -> None:
    q_body, q_camera = (np.array(q) / np.linalg.norm(q) for q in (body, camera))
    state = at(1, q_eci_from_body=q_body, q_eci_from_camera=q_camera, omega_body_rad_s=[0, 0, 0.1])
    expected = scipy_from(q_camera).inv() * scipy_from(q_body)
    np.testing.assert_allclose(state.craft.R_cam_from_body, expected.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(state.craft.rates.omega_body_rad_s, [0, 0, 0.1])
    np.testing.assert_array_equal(state.craft.rates.omega_camera_rad_s, np.zeros(3))


def test_a_state_of_the_scenario_is_the_same_by_index_and_by_its_own_values() -> None:
    trajectory = AQUA.trajectory
    by_index = at(3)
    by_values = at(
        3,
        t_s=float(trajectory.t_s[3]),
        r_rtn_m=trajectory.r_chaser_rtn_m[3],
        v_rtn_m_s=trajectory.v_chaser_rtn_m_s[3],
        q_eci_from_body=trajectory.q_eci_from_body[3],
        q_eci_from_camera=trajectory.q_eci_from_camera[3],
    )
    for name in ("R_cam_from_body", "t_body_cam_m", "sun_direction_cam", "sun_irradiance_rgb_w_m2"):
        np.testing.assert_allclose(
            getattr(by_values.craft, name), getattr(by_index.craft, name), rtol=1e-12, atol=1e-12
        )
    np.testing.assert_allclose(
        by_values.craft.rates.v_body_cam_m_s, by_index.craft.rates.v_body_cam_m_s, atol=1e-12
    )


def test_pointing_errors_follow_the_index_alone() -> None:
    jitter = {"attitude.camera": {"law": "pointing-error", "jitter_deg": [0.5, 0.5, 0.5]}}
    shaking = states(**jitter)
    one, again, other = (at(i, shaking, t_s=60.0, r_rtn_m=[0, -20, 0]) for i in (4, 4, 5))
    np.testing.assert_array_equal(one.craft.t_body_cam_m, again.craft.t_body_cam_m)
    assert not np.allclose(one.craft.t_body_cam_m, other.craft.t_body_cam_m, atol=1e-3)


def test_a_file_of_attitudes_is_read_once(tmp_path) -> None:
    """The laws are made once for all states, and a file's law reads its file once."""
    path = tmp_path / "a.npz"
    q = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, np.sqrt(0.75)]])
    record = {"t_s": np.array([0.0, 120.0]), "q_eci_from_body": q}
    write_table(path, AQUA.trajectory.epoch_utc, record)
    filed = states(**{"attitude.target": {"law": "file", "path": str(path)}})
    quarter = at(0, filed, t_s=90.0)
    path.unlink()
    again = at(0, filed, t_s=90.0)
    np.testing.assert_array_equal(again.craft.R_cam_from_body, quarter.craft.R_cam_from_body)
    # The body turns by 120° about z in 120 s, so after 90 s its x axis is ECI's y axis.
    x_eci = quarter.R_cam_from_eci.T @ quarter.craft.R_cam_from_body[:, 0]
    np.testing.assert_allclose(x_eci, [0, 1, 0], atol=1e-9)


def test_between_the_frames_of_a_file_the_motion_is_interpolated(tmp_path) -> None:
    """A file with a frame every 10 s, against the propagator that made it: Hermite's error is
    (10 s)⁴/384 times the fourth derivative, n⁴ r."""
    times_s = np.arange(0, 301, 10.0)
    exact = make_trajectory(
        load_scenario("aqua", REGISTRY, {"times": {"t_s": times_s.tolist()}}), REGISTRY
    )
    path = tmp_path / "t.npz"
    write_table(path, exact.epoch_utc, exact.arrays())
    recorded = {"times": None, "propagator": {"name": "file", "path": str(path)}}
    filed = states_of(load_scenario("aqua", REGISTRY, recorded))
    for t_s in (4.2, 155.0, 299.9):
        state, true = at(0, filed, t_s=t_s), at(0, t_s=t_s)
        np.testing.assert_allclose(state.r_target_eci_m, true.r_target_eci_m, atol=1e-3)
        np.testing.assert_allclose(state.craft.range_m, true.craft.range_m, atol=1e-6)
    np.testing.assert_array_equal(at(0, filed, t_s=30.0).r_target_eci_m, exact.r_target_eci_m[3])
    with pytest.raises(InputError, match=r"t_s is 301.*'file' is from 0 to 300 s"):
        at(0, filed, t_s=301.0)


def test_of_several_relative_orbits_one_must_be_named() -> None:
    many = states_of(load_scenario("posse-v2", REGISTRY, None))
    with pytest.raises(InputError, match="has 25 relative orbits at t_s = 0; give r_rtn_m"):
        at(0, many, t_s=0.0)
    assert at(0, many, t_s=0.0, r_rtn_m=[6, -22, 9]).craft.range_m == pytest.approx(np.sqrt(601))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"index": -1}, "index is -1"),
        ({"index": 5}, "has 5 frames, so none of index 5"),
        ({"t_s": float("nan")}, "t_s is nan"),
        ({"r_rtn_m": [1, 2]}, "r_rtn_m is [1, 2]; 3 finite numbers are needed"),
        ({"r_rtn_m": [1, 2, float("inf")]}, "3 finite numbers are needed"),
        ({"r_rtn_m": "near"}, "r_rtn_m is 'near'"),
        ({"v_rtn_m_s": [0, 0, 0]}, "v_rtn_m_s is given without r_rtn_m"),
        ({"omega_body_rad_s": [0, 0, 0]}, "omega_body_rad_s is given without q_eci_from_body"),
        ({"q_eci_from_body": [0, 0, 0, 0]}, "q_eci_from_body"),
        ({"q_eci_from_camera": [1, 1, 1, 1]}, "q_eci_from_camera"),
        ({"r_rtn_m": [0, 0, 0]}, "chaser is at the target"),
    ],
)
def test_what_is_no_state_is_refused_in_one_line(given, expected) -> None:
    with pytest.raises(InputError) as refused:
        at(**{"index": 0, **given})
    assert expected in str(refused.value)
    assert "\n" not in json.dumps(str(refused.value))
