"""The division of an exposure into moments, and the largest speed in an image."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_plate import HEIGHT, WIDTH, camera

from posse_core._model.camera import PixelBox
from posse_core._model.shutter import fastest_px_s, instants_s, moments

vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)
WHOLE = PixelBox(0, 0, WIDTH, HEIGHT)


@given(
    speed=st.floats(0, 1e4),
    line_s=st.floats(0, 1e-3),
    exposure_s=st.floats(0, 1),
    instants=st.integers(1, 20),
)
def test_every_row_is_exposed_once_and_around_its_own_time(speed, line_s, exposure_s, instants):
    made = camera(line_s)
    share, mean_s = np.zeros(HEIGHT), np.zeros(HEIGHT)
    for moment in moments(made, speed, 0.2, exposure_s, instants):
        rows = slice(moment.first_row, moment.first_row + moment.rows)
        share[rows] += moment.share
        mean_s[rows] += moment.share * moment.after_s
    np.testing.assert_allclose(share, 1)
    # Within a moment nothing moves by more than a fifth of a pixel, or the moment is a single row.
    longest_s = max(0.2 / max(speed, 1e-9), line_s) + line_s
    np.testing.assert_allclose(mean_s, made.row_after_s(np.arange(HEIGHT)), atol=longest_s / 2 + 1e-12)
    assert made.row_after_s(np.array([(HEIGHT - 1) / 2])) == 0


def test_instants_are_the_middles_of_equal_parts():
    np.testing.assert_allclose(instants_s(100.0, 0.2, 0.004, 100), [-0.001, 0.001])
    np.testing.assert_allclose(instants_s(1e6, 0.2, 0.9, 3), [-0.3, 0, 0.3], atol=1e-15)
    assert instants_s(1e6, 0.2, 0.9, 1) == [0]


@given(v=vectors, omega=vectors, near=st.floats(2, 50), seed=st.integers(0, 2**31))
def test_no_point_of_the_box_is_faster(v, omega, near, seed):
    """Against the projections of moving points at times a microsecond apart."""
    random = np.random.default_rng(seed)
    made, far = camera(), 3 * near
    uv = random.uniform([0, 0], [WIDTH - 1, HEIGHT - 1], (200, 2))
    x = made.rays(uv) * random.choice([near, far], (200, 1))
    moved = x + 1e-6 * (v + np.cross(omega, x))
    speeds = np.linalg.norm(made.project(moved) - made.project(x), axis=1) / 1e-6
    fastest = fastest_px_s(made, WHOLE, v, omega, near, far)
    assert speeds.max() <= 1.03 * fastest + 1e-3
    assert fastest <= 4 * speeds.max() + 1e-3


def test_a_rotating_camera_sees_the_stars_move_at_its_rate():
    fastest = fastest_px_s(camera(), WHOLE, np.zeros(3), np.array([0, 0.01, 0]), np.inf, np.inf)
    x = (WIDTH - 1) / 2 / 100
    assert fastest == pytest.approx(100 * 0.01 * (1 + x**2), rel=0.1)
