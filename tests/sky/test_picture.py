"""The Earth in an image, part of it interpolated, against its light computed in every pixel."""

import dataclasses

import numpy as np
import pytest

from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._sky.clouds import make_clouds
from posse_core._sky.earth import Earth
from posse_core._sky.ground import Ground, blue_marble
from posse_core._sky.picture import TOLERANCE, picture
from posse_core._sky.pyramid import Pyramid

R_M = 6.378137e6
SUN_W_M2_BAND = 186.0  # the largest band's at 1 au
VIEWS = {
    # altitude, direction in which the camera looks (radial, along), field of view, Sun
    "nadir": (7e5, (-1.0, 0.0), 90, (1.0, 0.2, 0.1)),
    "limb": (7e5, (-0.45, 0.9), 90, (1.0, 0.2, 0.1)),
    "the limb in the corner": (7e5, (-0.1, 0.9), 60, (0.2, 0.9, 0.1)),
    "low over the terminator": (3e5, (-0.8, 0.3), 100, (0.05, 1.0, 0.1)),
    "twilight": (7e5, (-0.6, 0.8), 70, (-0.3, 1.0, 0.0)),
    "night with twilight at the limb": (7e5, (-0.5, 0.8), 80, (-0.5, 0.85, 0.1)),
    "glint": (7e5, (-0.7, 0.7), 40, (0.7, 0.7, 0.0)),
    "geostationary": (3.6e7, (-1.0, 0.02), 30, (0.5, 0.8, 0.1)),
    "a telescope from there": (3.6e7, (-1.0, 0.1), 3, (0.5, 0.8, 0.1)),
    "from the Moon": (3.8e8, (-1.0, 0.01), 12, (0.5, 0.8, 0.1)),
    "over the pole": (8e5, (-1.0, 0.1), 80, (0.4, 0.3, 0.9)),
}


def _plain() -> Earth:
    """Grey land under real air, so that all light varies smoothly but at the limb."""
    land = np.full((64, 128, 3), 150, np.uint8)
    return Earth(Ground(Pyramid(np.dstack([land, np.full((64, 128, 1), 60, np.uint8)]))), clouds=None)


def _both(earth: Earth, camera, frame, bands=((0, 0),)) -> tuple[np.ndarray, np.ndarray]:
    view = earth.seen(frame)
    drawn = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    for first_row, rows in bands:
        for box, light in picture(view, camera, first_row, rows or camera.height_px):
            drawn[box.slices] += light
    v, u = np.mgrid[: camera.height_px, : camera.width_px]
    rays = camera.rays(np.stack([u, v], axis=-1).reshape(-1, 2))
    return drawn, view.light(rays, camera.pixel_rad).reshape(drawn.shape)


def _frame(make_state, name: str):
    altitude_m, (radial, along), _, sun = VIEWS[name]
    zenith = np.array([0.0, 0.05, 1.0] if "pole" in name else [0.8, 0.3, 0.52])
    zenith /= np.linalg.norm(zenith)
    east = np.cross([0.3, 0.1, 0.9], zenith)
    east /= np.linalg.norm(east)
    axes = np.stack([zenith, east, np.cross(zenith, east)])
    return make_state(
        r_camera_m=(R_M + altitude_m) * zenith,
        forward=radial * zenith + along * east,
        up=0.3 * zenith + 0.1 * east + axes[2],
        sun=np.asarray(sun) @ axes,
        t_s=3000.0,
    )


@pytest.mark.parametrize("name", VIEWS)
def test_smooth_light_is_within_the_tolerance(make_camera, make_state, name: str) -> None:
    camera = make_camera(640, 480, hfov_deg=VIEWS[name][2])
    drawn, exact = _both(_plain(), camera, _frame(make_state, name))
    assert exact.max() > 0.1
    # Interpolation is along two axes; light is a sum of three parts, of which each may be off.
    np.testing.assert_allclose(drawn, exact, atol=6 * TOLERANCE * SUN_W_M2_BAND)
    assert np.abs(drawn - exact).mean() < 0.3 * TOLERANCE * SUN_W_M2_BAND


@pytest.mark.parametrize("name", VIEWS)
def test_ground_and_clouds_are_where_they_are(make_camera, make_state, name: str) -> None:
    """An error of a pixel's fifth moves an edge of a cloud, so light differs where the slope is great;
    but no more than if the exact image were shifted by that much."""
    camera = make_camera(640, 480, hfov_deg=VIEWS[name][2])
    drawn, exact = _both(Earth(blue_marble(), make_clouds(0)), camera, _frame(make_state, name))
    off = np.abs(drawn - exact)
    slope = np.abs(np.diff(exact, axis=0))[:, 1:] + np.abs(np.diff(exact, axis=1))[1:]
    assert off.mean() < 0.1 * slope.mean()
    assert np.quantile(off, 0.999) < 0.3 * np.quantile(slope, 0.999)
    assert drawn.mean(dtype=float) == pytest.approx(exact.mean(dtype=float), rel=1e-3)


@pytest.mark.parametrize("lens", [BrownConrady(-0.22, 0.03, 0.002, -0.003, 0.0), Fisheye()])
def test_a_lens_and_bands_of_rows_make_no_difference(make_camera, make_state, lens) -> None:
    camera = dataclasses.replace(make_camera(333, 245, hfov_deg=75), distortion=lens)
    bands = [(0, 1), (1, 2), (3, 3), (6, 100), (106, 139)]
    drawn, exact = _both(_plain(), camera, _frame(make_state, "limb"), bands)
    np.testing.assert_allclose(drawn, exact, atol=6 * TOLERANCE * SUN_W_M2_BAND)


def test_a_small_earth_is_not_missed(make_camera, make_state) -> None:
    """From 2·10⁹ m away it is three pixels wide, less than the distance of nodes; its light is that of
    an Earth of hundreds."""
    light = []
    for hfov_deg in (110, 0.8):
        camera = make_camera(640, 480, hfov_deg)
        for aside in (0.0, 0.31, 0.7) if hfov_deg == 110 else (0.0,):
            frame = make_state(
                r_camera_m=(2e9, 0, 0), forward=(-1.0, aside, 0.2 * aside), sun=(1.0, 0.3, 0.0)
            )
            drawn = np.zeros((480, 640, 3))
            for box, part in picture(_plain().seen(frame), camera, 0, 480):
                drawn[box.slices] += part
            v, u = np.mgrid[:480, :640]
            rays = camera.rays(np.stack([u, v], axis=-1))
            solid = 1 / (camera.fx_px**2 * np.linalg.norm(rays, axis=-1) ** 3)
            light.append(np.einsum("ij,ijk->k", solid, drawn))
    np.testing.assert_allclose(light[:3], np.broadcast_to(light[3], (3, 3)), rtol=0.01)
