"""The Sun's disc: its irradiance, its limb darkening and its eclipses."""

import numpy as np
import pytest

from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._scenario.sky import SkyConfig
from posse_core._sky.sky import Sky

DARK = SkyConfig(earth=False, stars=None)


def _solid_angle_sr(camera) -> np.ndarray:
    """(H, W) solid angles of a pinhole's pixels: dΩ = cos³ / (fx fy)."""
    v, u = np.mgrid[: camera.height_px, : camera.width_px]
    rays = camera.rays(np.stack([u, v], axis=-1))
    return 1 / (camera.fx_px * camera.fy_px * np.linalg.norm(rays, axis=-1) ** 3)


@pytest.mark.parametrize("forward", [(1.0, 0.0, 0.0), (1.0, 0.02, 0.03), (1.0, 0.06, 0.0)])
def test_the_disc_gives_the_suns_irradiance(make_camera, make_state, forward) -> None:
    camera = make_camera(320, 240, hfov_deg=10)
    frame = make_state(forward=forward)
    sky = Sky(DARK, camera, seed=0).look(frame)
    irradiance = np.einsum("ij,ijk->k", _solid_angle_sr(camera), sky.radiance_rgb.astype(float))
    assert irradiance == pytest.approx(1361.0 * SOLAR_BAND_FRACTIONS, rel=0.005)
    lit = np.argwhere(sky.radiance_rgb[..., 1] > 0)
    away = frame.R_cam_from_eci @ np.array([1.0, 0.0, 0.0])
    width_px = 2 * camera.fx_px * frame.craft.sun_angular_radius_rad / away[2] ** 2
    assert np.ptp(lit[:, 1]) + 1 == pytest.approx(width_px, abs=2)


def test_the_limb_is_darker_and_redder(make_camera, make_state) -> None:
    camera = make_camera(321, 241, hfov_deg=1)
    rgb = Sky(DARK, camera, seed=0).look(make_state(forward=(1.0, 0.0, 0.0))).radiance_rgb
    row = rgb[120, :, :].astype(float)
    across = np.flatnonzero(row[:, 1])
    centre, rim = row[160], row[across[3]]
    assert (rim < 0.7 * centre).all()
    assert rim[2] / centre[2] < rim[0] / centre[0]


def test_no_sun_if_switched_off_behind_the_camera_or_fully_eclipsed(make_camera, make_state) -> None:
    camera = make_camera()
    off = SkyConfig(earth=False, stars=None, sun_disc=False)
    ahead = make_state(forward=(1.0, 0.0, 0.0))
    assert Sky(off, camera, 0).look(ahead).radiance_rgb is None
    assert Sky(DARK, camera, 0).look(make_state(forward=(-1.0, 0.0, 0.0))).radiance_rgb is None
    eclipsed = make_state(forward=(1.0, 0.0, 0.0), sun_fraction_camera=0.0)
    assert Sky(DARK, camera, 0).look(eclipsed).radiance_rgb is None


def test_the_earth_covers_the_part_below_its_limb(make_camera, make_state) -> None:
    """If the centre of the Sun is on the limb, half its light remains."""
    camera = make_camera(320, 240, hfov_deg=10)
    r = 7.08e6
    limb = np.pi - np.arcsin(6.378137e6 / r)  # from the zenith, in the equator's plane
    sun = (np.cos(limb), np.sin(limb), 0.0)
    frame = make_state(r_camera_m=(r, 0.0, 0.0), forward=sun, sun=sun)
    rgb = Sky(DARK, camera, seed=0).look(frame).radiance_rgb.astype(float)
    total = np.einsum("ij,ijk->k", _solid_angle_sr(camera), rgb)
    assert total / (1361.0 * SOLAR_BAND_FRACTIONS) == pytest.approx(0.5, abs=0.02)
