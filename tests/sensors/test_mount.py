"""A sensor beside the camera: places and rates against differences of places that move rigidly."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from posse_core._model.craft_state import Rates
from posse_core._model.mount import Mount
from posse_core._model.scene import FrameState
from posse_core._scenario.sensors import MOST_READINGS, MountConfig, SensorChoice
from posse_core.testing import scenes

SMALL = st.floats(-1, 1, allow_nan=False)
VECTORS = st.tuples(SMALL, SMALL, SMALL).map(np.array)


def moving(rates: Rates) -> FrameState:
    state = scenes.frame(t_body_cam_m=(1.0, -2.0, 9.0), sun_direction_body=(0.2, 0.3, 1.0))
    return replace(state, craft=replace(state.craft, rates=rates))


@given(VECTORS, VECTORS, VECTORS, VECTORS, VECTORS, VECTORS)
def test_points_are_where_the_mount_puts_them_then_and_later(place, turn, v, body, camera, point):
    """Body points seen by the sensor are those that the camera sees, moved by the mount, and so they are
    a moment later: the sensor's rates are those of a rigid chaser."""
    mount = Mount(place, Rotation.from_rotvec(turn).as_matrix())
    state = moving(Rates(v, 0.1 * body, 0.1 * camera))
    seen = state.seen_from(mount)
    for after_s, error_m in ((0.0, 1e-12), (1e-4, 1e-9)):
        by_camera = state.craft.in_camera(point, np.array(after_s))
        by_sensor = seen.craft.in_camera(point, np.array(after_s))
        expected = mount.R_camera_from_sensor.T @ (by_camera - place)
        # Over a moment dt the sensor's straight line differs from its arc by |p| (ω dt)².
        np.testing.assert_allclose(by_sensor, expected, rtol=0, atol=error_m)


@given(VECTORS, VECTORS)
def test_sun_and_earth_are_the_same_from_everywhere_on_the_chaser(place, turn):
    mount = Mount(place, Rotation.from_rotvec(turn).as_matrix())
    state = moving(Rates(*np.zeros((3, 3))))
    seen = state.seen_from(mount)
    np.testing.assert_allclose(
        mount.R_camera_from_sensor @ seen.craft.sun_direction_cam,
        state.craft.sun_direction_cam,
        atol=1e-12,
    )
    # Geocentric place of the craft's origin, by either.
    for one in (state, seen):
        origin = one.r_camera_eci_m + one.R_cam_from_eci.T @ one.craft.t_body_cam_m
        np.testing.assert_allclose(origin, state.r_target_eci_m, atol=1e-8)


def test_a_rotation_turns_the_cameras_axes_into_the_sensors():
    """By 90° about the camera's y, which points down, forward becomes right."""
    mount = MountConfig(rotation_vector_deg=(0, 90, 0)).mount()
    np.testing.assert_allclose(mount.R_camera_from_sensor[:, 2], [1, 0, 0], atol=1e-12)
    half = np.sqrt(0.5)
    same = MountConfig(q_camera_from_sensor=(half, 0, half, 0)).mount()
    np.testing.assert_allclose(same.R_camera_from_sensor, mount.R_camera_from_sensor, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"rotation_vector_deg": (0, 1, 0), "q_camera_from_sensor": (1, 0, 0, 0)}, "not both"),
        ({"q_camera_from_sensor": (2, 0, 0, 0)}, "has length 2, not 1"),
    ],
)
def test_a_mount_that_is_none_is_refused(keys, words):
    with pytest.raises(ValidationError, match=words):
        MountConfig(**keys)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_readings_fill_the_time_until_the_next_frame(rate_hz, duration_s):
    choice = SensorChoice.model_validate({"type": "camera", "rate_hz": rate_hz})
    if duration_s * rate_hz > MOST_READINGS:
        with pytest.raises(ValueError, match="lower rate_hz"):
            choice.instants_s(duration_s)
        return
    instants_s = np.array(choice.instants_s(duration_s))
    assert instants_s[0] == 0
    np.testing.assert_allclose(np.diff(instants_s), 1 / rate_hz, rtol=1e-9)
    assert (instants_s[1:] < duration_s).all()
    assert instants_s[-1] + 1 / rate_hz >= duration_s * (1 - 1e-9)


def test_a_reading_at_the_next_frames_instant_is_that_frames():
    choice = SensorChoice.model_validate({"type": "camera", "rate_hz": 10})
    assert choice.instants_s(0.1 * 3) == (0.0, 0.1, 0.2)
    assert choice.instants_s(0.0) == (0.0,)
