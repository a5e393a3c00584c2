"""Ranges without noise against closed forms: planes, a sphere, and what moves while it is scanned."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._model.spacecraft import Part
from posse_core.testing import scenes

EXACT = {"shot": False, "receiver_e": 0.0, "range_m": 0.0}
AXES = {
    "noise": EXACT,
    "pattern": {"shape": "raster", "rays": 1, "columns": 30, "rows": 20, "width_deg": 6},
}


def raster(**keys):
    return {**AXES, "pattern": {**AXES["pattern"], **keys}}


@given(st.integers(0, 2**32 - 1), st.sampled_from([5.0, 300.0]))
def test_a_tilted_plane(sense, seed, distance_m):
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix() @ scenes.FACING
    wall = scenes.rectangle("wall", "matt", u_m=(distance_m, 0, 0), v_m=(0, distance_m, 0))
    t = np.array([0.1, 0.2, distance_m])
    arrays = sense([wall], raster(), t_m=t, R_cam_from_body=R).arrays
    axis = arrays["direction_sensor"]
    expected = (R[:, 2] @ t) / (axis @ R[:, 2])
    for name in ("range_m", "true_range_m"):
        np.testing.assert_allclose(arrays[name], expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(arrays["point_sensor_m"], expected[:, None] * axis, rtol=0, atol=1e-9)
    np.testing.assert_allclose((arrays["point_sensor_m"] - t) @ R[:, 2], 0, atol=1e-9)
    assert (arrays["part_id"] == 0).all()


def test_a_sphere(sense):
    """A cap whose facets leave the sphere by at most 0.6 µm."""
    radius_m, cells = 5.0, 240
    grid = np.linspace(-0.4, 0.4, cells + 1)
    x, y = np.meshgrid(grid, grid)
    points = np.stack([x, y, np.sqrt(radius_m**2 - x**2 - y**2)], -1).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, above = corner + 1, corner + cells + 1
    faces = np.concatenate(
        [np.stack([corner, right, above], -1), np.stack([right, above + 1, above], -1)]
    )
    cap = Part(
        "cap",
        points,
        faces.astype(np.int32),
        (points / radius_m).astype(np.float32),
        np.zeros((len(points), 2), np.float32),
        "matt",
    )
    arrays = sense([cap], raster(width_deg=1.0, height_deg=1.0), t_m=(0, 0, 40)).arrays
    axis = arrays["direction_sensor"]
    along = axis[:, 2] * 40
    expected = along - np.sqrt(along**2 - 40**2 + radius_m**2)
    np.testing.assert_allclose(arrays["range_m"], expected, rtol=0, atol=1e-6)
    assert np.ptp(arrays["range_m"]) > 5e-3


@given(st.integers(0, 2**32 - 1))
def test_a_plane_that_moves_while_it_is_scanned(sense, seed):
    """Each beam meets it where the rates have taken it: a plane that turns and goes, before a sensor
    that turns, by SciPy's rotations."""
    rng = np.random.default_rng(seed)
    v, omega_body, omega_camera = rng.uniform(-1, 1, (3, 3)) * [[1.0], [0.25], [0.04]]
    wall = scenes.rectangle("wall", "matt", u_m=(60, 0, 0), v_m=(0, 60, 0))
    t = np.array([0.0, 0.0, 30.0])
    arrays = sense(
        [wall],
        raster(duration_s=2.0, height_deg=5.0),
        t_m=t,
        R_cam_from_body=np.eye(3),
        rates=(v, omega_body, omega_camera),
    ).arrays
    after_s, axis = arrays["after_s"], arrays["direction_sensor"]
    np.testing.assert_allclose(after_s, np.arange(600) * 2 / 600)
    # In axes that do not turn, equal to the sensor's at the reading's instant.
    beam = Rotation.from_rotvec(after_s[:, None] * omega_camera).apply(axis)
    normal = Rotation.from_rotvec(after_s[:, None] * omega_body).apply([0.0, 0.0, 1.0])
    middle = t + after_s[:, None] * v
    expected = np.sum(normal * middle, 1) / np.sum(normal * beam, 1)
    np.testing.assert_allclose(arrays["range_m"], expected, rtol=0, atol=1e-9)
    still = (t[2] / axis[:, 2])[after_s > 1]
    assert np.abs(expected[after_s > 1] - still).max() > 0.05


def test_a_plate_that_slides_is_sheared(sense):
    """A scan from the top to the bottom sees its left edge move on by the speed times the time."""
    plate = scenes.rectangle("plate", "matt", u_m=(1, 0, 0), v_m=(0, 3, 0))
    keys = raster(columns=600, rows=9, width_deg=12.0, height_deg=8.0, duration_s=4.0)
    arrays = sense([plate], keys, t_m=(0, 0, 20), rates=((0.3, 0, 0), (0, 0, 0), (0, 0, 0))).arrays
    hit = (arrays["part_id"] >= 0).reshape(9, 600)
    x = (arrays["direction_sensor"][:, 0] / arrays["direction_sensor"][:, 2] * 20).reshape(9, 600)
    after_s = arrays["after_s"].reshape(9, 600)
    step_m = np.diff(x[0]).max()
    for row in range(9):
        first = hit[row].argmax()
        assert -1 + 0.3 * after_s[row, first] == pytest.approx(x[row, first], abs=1.1 * step_m)
    assert hit.sum() > 500


@pytest.mark.parametrize("side", [1, 2, 3])
def test_a_flash_measures_the_middles_of_its_pixels(sense, side):
    """The mean over a pixel of a plane is its middle's, but for the pixel's perspective."""
    wall = scenes.rectangle("wall", "matt", u_m=(60, 0, 0), v_m=(0, 60, 0))
    R = Rotation.from_rotvec([0.3, -0.4, 0]).as_matrix() @ scenes.FACING
    pattern = {"shape": "flash", "width_px": 20, "height_px": 10, "hfov_deg": 4, "rays_per_side": side}
    arrays = sense(
        [wall], {"noise": EXACT, "pattern": pattern}, t_m=(0, 0, 20), R_cam_from_body=R
    ).arrays
    expected = 20 * R[2, 2] / (arrays["direction_sensor"] @ R[:, 2])
    np.testing.assert_allclose(arrays["true_range_m"], expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(arrays["range_m"], expected, rtol=0, atol=1e-9 if side == 1 else 1e-3)


def test_a_flash_sees_all_at_one_instant(sense):
    plate = scenes.rectangle("plate", "matt", u_m=(1, 0, 0), v_m=(0, 3, 0))
    keys = {
        "noise": EXACT,
        "pattern": {"shape": "flash", "width_px": 40, "height_px": 30, "hfov_deg": 12},
    }
    moving = ((0.3, 0, -0.8), (0.1, 0.2, 0.3), (0.1, 0, 0))
    flown, still = (sense([plate], keys, t_m=(0, 0, 20), rates=r) for r in (moving, ((0, 0, 0),) * 3))
    for name, array in still.arrays.items():
        np.testing.assert_array_equal(flown.arrays[name], array)
    assert (still.arrays["after_s"] == 0).all()
    u, v = np.meshgrid(np.arange(40) - 19.5, np.arange(30) - 14.5)
    focal_px = 20 / np.tan(np.radians(6))
    d = still.arrays["direction_sensor"]
    np.testing.assert_allclose(
        d[:, :2] / d[:, 2:] * focal_px, np.stack([u.ravel(), v.ravel()], 1), atol=1e-9
    )


def test_what_is_not_there_returns_nothing(sense):
    plate = scenes.rectangle("plate", "matt", u_m=(0.3, 0, 0), v_m=(0, 0.3, 0))
    reading = sense([plate], raster(), t_m=(0, 0, 20))
    hit = reading.arrays["part_id"] >= 0
    assert 0 < hit.sum() < 300
    for name in ("range_m", "true_range_m", "intensity_e"):
        assert (np.isnan(reading.arrays[name]) == ~hit).all()
    assert np.isnan(reading.arrays["point_sensor_m"][~hit]).all()
    assert reading.labels == {"beams": 600, "returns": hit.sum(), "drop_outs": 0, "saturated": 0}


def test_bias_and_resolution(sense):
    wall = scenes.rectangle("wall", "matt", u_m=(9, 0, 0), v_m=(0, 9, 0))
    for bias_m in (0.0, 0.37):
        keys = {**raster(), "ranging": {"bias_m": bias_m, "resolution_m": 0.25}}
        arrays = sense([wall], keys, t_m=(0, 0, 20)).arrays
        steps = arrays["range_m"] / 0.25
        np.testing.assert_array_equal(steps, np.rint(steps))
        error = arrays["range_m"] - bias_m - arrays["true_range_m"]
        assert np.abs(error).max() <= 0.125 + 1e-12
