"""The sky with a distorting lens: positions as OpenCV projects them, no gaps, and no light lost."""

import dataclasses

import erfa
import numpy as np
import pytest
from by_opencv import flat_of, projected_px
from starlight import apparent

from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._scenario.sky import SkyConfig
from posse_core._sky.ellipsoid import entry_distance_m
from posse_core._sky.sky import Sky
from posse_core._sky.stars import hipparcos

BARREL = BrownConrady(-0.22, 0.03, 0.002, -0.003, 0.0)
PINCUSHION = BrownConrady(0.15, 0.03, -0.002, 0.003, 0.0)
RATIONAL = BrownConrady(0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02)
FISHEYE = Fisheye(-0.02, 0.01, -0.003, 0.0005)
LENSES = pytest.mark.parametrize(
    "lens",
    [BARREL, PINCUSHION, RATIONAL, FISHEYE],
    ids=["barrel", "pincushion", "rational", "fisheye"],
)


@pytest.fixture
def lensed(make_camera):
    return lambda lens, *size, **more: dataclasses.replace(make_camera(*size, **more), distortion=lens)


@LENSES
def test_stars_are_where_opencv_projects_them(lensed, make_state, lens):
    camera = lensed(lens, 640, 480, hfov_deg=70)
    frame = make_state(forward=erfa.s2c(1.2, 0.3), r_camera_m=(3e6, 6e6, 2e6))
    found = Sky(SkyConfig(earth=False), camera, seed=0).look(frame).points_px
    stars = apparent(hipparcos(6.5).directions_at(frame.epoch_jd_tt), frame.epoch_jd_tt)
    away = stars @ frame.R_cam_from_eci.T
    away = away[np.hypot(*away[:, :2].T) < lens.reach * away[:, 2]]  # in front, and not folded over
    uv = projected_px(camera, away)
    expected = uv[np.all((uv >= -0.5) & (uv <= [639.5, 479.5]), axis=1)]
    assert len(expected) > 200
    inside = found[np.all((found >= -0.5) & (found <= [639.5, 479.5]), axis=1)]
    assert len(inside) == len(expected)
    assert np.linalg.norm(expected[:, None] - inside[None], axis=2).min(axis=1).max() < 1e-6


@LENSES
@pytest.mark.parametrize("forward", [(1.0, 0.005, 0.0), (1.0, 0.04, 0.03)])
def test_the_suns_disc_keeps_its_light(lensed, make_state, lens, forward):
    """Integrated over the pixels' solid angles, which OpenCV's rays give."""
    camera = lensed(dataclasses.replace(lens, k1=60 * lens.k1), 160, 120, hfov_deg=6)
    frame = make_state(forward=forward)
    sky = Sky(SkyConfig(earth=False, stars=None), camera, seed=0).look(frame)
    v, u = np.mgrid[:120, :160].astype(float)
    flat = [
        flat_of(camera, np.stack([u + du, v + dv], -1))
        for du, dv in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (0, 0))
    ]
    right, down = flat[0] - flat[1], flat[2] - flat[3]
    area = right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0]
    solid_sr = area / (1 + (flat[4] ** 2).sum(axis=-1)) ** 1.5
    irradiance = np.einsum("ij,ijk->k", solid_sr, sky.radiance_rgb.astype(float))
    assert irradiance == pytest.approx(1361.0 * SOLAR_BAND_FRACTIONS, rel=0.005)
    pixel = camera.area_seen(np.stack([u, v], -1)) / (camera.fx_px * camera.fy_px)
    np.testing.assert_allclose(pixel, area, rtol=1e-4)


@LENSES
def test_the_earth_covers_all_pixels_of_its_ellipsoid(lensed, make_state, lens):
    """Every pixel whose ray hits the ellipsoid is bright, right up to the border of the image."""
    camera = lensed(lens, 333, 245, hfov_deg=75)
    r = 7.08e6
    limb = np.pi - np.arcsin(6.378137e6 / r)
    frame = make_state(r_camera_m=(r, 0, 0), forward=(np.cos(limb), np.sin(limb), 0.2))
    radiance = Sky(SkyConfig(stars=None), camera, seed=0).look(frame).radiance_rgb
    v, u = np.mgrid[:245, :333].astype(float)
    rays = np.dstack([flat_of(camera, np.stack([u, v], -1)), np.ones((245, 333))])
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    entry = entry_distance_m(frame.r_camera_eci_m, rays @ frame.R_cam_from_eci)
    on_earth = np.isfinite(entry)
    assert 0.2 < on_earth.mean() < 0.9
    assert np.all(radiance[on_earth].sum(axis=-1) > 0)
    below_air = ~on_earth  # 100 km above the limb there is no light
    nearest = np.linalg.norm(np.cross(frame.r_camera_eci_m, rays @ frame.R_cam_from_eci), axis=-1)
    assert np.all(radiance[below_air & (nearest > 6.378137e6 + 1.2e5)] < 1e-3 * radiance.max())
