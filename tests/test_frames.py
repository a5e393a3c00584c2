"""Frames and rotations: what must hold for every state and every rotation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from posse_core import _frames as frames

axis_values = st.floats(-1, 1)
angles = st.sampled_from([0.0, 1e-12, 1e-8, 1e-4, 1.0, np.pi - 1e-4, np.pi - 1e-8, np.pi - 1e-12, np.pi])


@st.composite
def rotations(draw: Any) -> Any:
    """An axis and an angle, half turns and no turns among them."""
    axis = np.array([draw(axis_values) for _ in range(3)])
    assume(np.linalg.norm(axis) > 1e-3)
    return axis / np.linalg.norm(axis), draw(angles)


def rodrigues(axis: Any, angle: float) -> Any:
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@given(rotations())
def test_a_matrix_survives_the_way_through_its_quaternion(rotation: Any) -> None:
    R = rodrigues(*rotation)
    q = frames.quaternion_from_matrix(R)
    assert abs(np.linalg.norm(q) - 1) < 1e-13
    assert q[0] >= 0
    assert np.max(np.abs(frames.matrix_from_quaternion(q) - R)) < 1e-13
    assert np.max(np.abs(frames.matrix_from_quaternion(-q) - R)) < 1e-13


@given(rotations())
def test_a_quaternion_is_half_the_angle_about_the_axis(rotation: Any) -> None:
    axis, angle = rotation
    half = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    q = frames.quaternion_from_matrix(rodrigues(axis, angle))
    assert min(np.max(np.abs(q - half)), np.max(np.abs(q + half))) < 1e-13


@st.composite
def orbital_states(draw: Any) -> Any:
    r = np.array([draw(st.floats(-4e7, 4e7)) for _ in range(3)])
    v = np.array([draw(st.floats(-8e3, 8e3)) for _ in range(3)])
    assume(np.linalg.norm(r) > 6e6)
    assume(np.linalg.norm(np.cross(r, v)) > 1e-2 * np.linalg.norm(r) * np.linalg.norm(v) > 0)
    return r, v


@given(orbital_states())
def test_rtn_axes_are_a_right_handed_frame_on_the_orbit(state: Any) -> None:
    r, v = state
    R = frames.R_eci_from_rtn(r, v)
    assert np.max(np.abs(R.T @ R - np.eye(3))) < 1e-13
    assert np.linalg.det(R) == pytest.approx(1, abs=1e-13)
    assert R[:, 0] == pytest.approx(r / np.linalg.norm(r), abs=1e-15)
    assert R[:, 1] @ v > 0
    assert abs(R[:, 2] @ v) < 1e-10 * np.linalg.norm(v)


@given(orbital_states(), st.tuples(*[st.floats(-1e4, 1e4)] * 3), st.tuples(*[st.floats(-10, 10)] * 3))
def test_a_relative_state_survives_the_way_through_eci(state: Any, r_rtn: Any, v_rtn: Any) -> None:
    chaser = frames.eci_from_rtn(*state, np.array(r_rtn), np.array(v_rtn))
    back_r, back_v = frames.rtn_from_eci(*state, *chaser)
    # Rounding of positions of 7e7 m, and of a rate of up to 2e-3 rad/s times them.
    assert back_r == pytest.approx(np.array(r_rtn), abs=1e-7)
    assert back_v == pytest.approx(np.array(v_rtn), abs=1e-9)


def test_the_rotating_frames_velocity_is_the_slope_of_the_position() -> None:
    # Straight flight of both craft: no force, so no dynamics is taken for granted.
    r, v = np.array([7e6, 1e5, -3e5]), np.array([-50.0, 7.4e3, 900.0])
    apart, speed = np.array([120.0, -80.0, 40.0]), np.array([0.3, -0.1, 0.2])

    def at(t: float) -> Any:
        target, chaser = r + v * t, r + apart + (v + speed) * t
        return frames.rtn_from_eci(target, v, chaser, v + speed)

    slope = (at(0.5)[0] - at(-0.5)[0]) / 1.0
    assert at(0.0)[1] == pytest.approx(slope, abs=1e-7)


def test_lvlh_is_v_bar_h_bar_r_bar() -> None:
    radial, along, cross = np.eye(3)
    assert frames.R_LVLH_FROM_RTN @ along == pytest.approx(np.array([1, 0, 0]))
    assert frames.R_LVLH_FROM_RTN @ -cross == pytest.approx(np.array([0, 1, 0]))
    assert frames.R_LVLH_FROM_RTN @ -radial == pytest.approx(np.array([0, 0, 1]))
    assert np.linalg.det(frames.R_LVLH_FROM_RTN) == pytest.approx(1)
    assert frames.R_GL_FROM_CAM @ np.array([1, 2, 3]) == pytest.approx(np.array([1, -2, -3]))


def test_lvlh_of_an_ellipse_follows_the_horizon_and_not_the_velocity() -> None:
    # At e = 0.52 the flight-path angle reaches asin(0.52) = 31.3° (Vallado 2013, eq. 2-15).
    e = 0.52
    f = np.arccos(-e)
    r = np.array([np.cos(f), np.sin(f), 0.0]) * (1 - e**2) / (1 + e * np.cos(f))
    v = np.array([-np.sin(f), e + np.cos(f), 0.0])
    along = frames.R_eci_from_rtn(r, v)[:, 1]
    angle = np.arccos(along @ v / np.linalg.norm(v))
    assert np.degrees(angle) == pytest.approx(31.33, abs=0.01)


@pytest.mark.parametrize("v", [np.array([7e3, 0, 0]), np.zeros(3), np.array([np.nan, 0, 0])])
def test_without_a_plane_there_is_no_frame(v: Any) -> None:
    with pytest.raises(ValueError, match="without a direction"):
        frames.R_eci_from_rtn(np.array([7e6, 0, 0]), v)


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(directions, directions)
def test_z_is_taken_to_the_direction_by_a_rotation(direction: Any, hint: Any) -> None:
    direction = np.array(direction) / np.linalg.norm(direction)
    for R in (frames.R_from_z(direction, hint), frames.R_with_z(direction)):
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_allclose(R[:, 2], direction, atol=1e-9)


@given(directions, directions)
def test_the_least_rotation_turns_by_the_angle_between_the_vectors(before: Any, after: Any) -> None:
    before, after = (np.array(v) / np.linalg.norm(v) for v in (before, after))
    assume(before @ after > -0.999)
    R = frames.R_least(before, after)
    np.testing.assert_allclose(R @ before, after, atol=1e-9)
    angle = np.arccos(np.clip(before @ after, -1, 1))
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(angle), abs=1e-9)


@given(directions, directions)
def test_the_cross_matrix_multiplies_as_the_cross_product(x: Any, y: Any) -> None:
    np.testing.assert_allclose(frames.cross_matrix(np.array(x)) @ y, np.cross(x, y), atol=1e-15)
