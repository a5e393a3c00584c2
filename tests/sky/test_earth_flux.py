"""The Earth's light at any resolution, against rays so fine that nothing is averaged within them."""

import numpy as np
import pytest

from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._sky.clouds import make_clouds
from posse_core._sky.earth import Earth, EarthView
from posse_core._sky.environment import environment_map
from posse_core._sky.ground import blue_marble
from posse_core._sky.picture import picture

R_M = 6.378137e6
FINE_M = 500.0
"""Footprint of the rays that count as the truth: the finest structure of the clouds."""
WHITE_W_M2_SR = 1361.0 * SOLAR_BAND_FRACTIONS.mean() / np.pi
SUNS = {"full": (1.0, 0.3, 0.2), "half": (0.1, 1.0, -0.3), "crescent": (-0.55, 0.8, 0.2)}
FIELDS = {300e3: 90.0, 700e3: 90.0, 2e6: 90.0, 8e6: 60.0, 3.5786e7: 18.0, 1.2e8: 7.0}
"""Altitude and width of the image, degrees."""


@pytest.fixture(scope="module")
def earth() -> Earth:
    return Earth(blue_marble(), make_clouds(0))


def _over_africa(make_state, altitude_m: float, sun: str):
    """The camera looks at the nadir."""
    zenith = np.array([0.85, 0.3, 0.15])
    zenith /= np.linalg.norm(zenith)
    east = np.cross([0.0, 0.0, 1.0], zenith)
    east /= np.linalg.norm(east)
    axes = np.stack([zenith, east, np.cross(zenith, east)])
    return make_state(
        r_camera_m=(R_M + altitude_m) * zenith,
        forward=-zenith,
        sun=np.array(SUNS[sun]) @ axes,
    )


def _stratified(count: int, seed: int) -> np.ndarray:
    """(2, count, count) random numbers of 0 … 1, one pair in each cell of a square."""
    cells = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    return (cells + np.random.default_rng(seed).random(cells.shape)) / count


def _solid(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Solid angle per area in the plane at distance 1."""
    return (1 + x**2 + y**2) ** -1.5


def _fine_w_m2(view: EarthView, altitude_m: float, half: float, count: int = 450) -> np.ndarray:
    """(3,) light that enters the camera in a square field, as tan of half its width."""
    x, y = half * (2 * _stratified(count, 1) - 1)
    light = view.light(np.stack([x, y, np.ones_like(x)], axis=-1), FINE_M / altitude_m)
    return 4 * half**2 * np.einsum("ij,ijk->k", _solid(x, y), light.astype(float)) / count**2


def _pictured_w_m2(view: EarthView, camera) -> np.ndarray:
    image = np.zeros((camera.height_px, camera.width_px, 3))
    for box, light in picture(view, camera, 0, camera.height_px):
        image[box.slices] += light
    u = (np.arange(camera.width_px) - camera.cx_px) / camera.fx_px
    return np.einsum("ij,ijk->k", _solid(u[:, None], u), image) / camera.fx_px**2


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("altitude_m", FIELDS)
def test_light_does_not_depend_on_the_resolution(
    earth, make_camera, make_state, altitude_m: float, sun: str
) -> None:
    """A pixel gets the mean of the light in it, and not the light of the mean clouds. Where only a
    crescent is lit, light may be off by 0.05 % of a white Earth's."""
    view = earth.seen(_over_africa(make_state, altitude_m, sun))
    fov_deg = FIELDS[altitude_m]
    half = np.tan(np.deg2rad(fov_deg) / 2)
    expected = pytest.approx(
        _fine_w_m2(view, altitude_m, half), rel=0.01, abs=5e-4 * WHITE_W_M2_SR * 4 * half**2
    )
    for width_px in (22, 100, 300, 900):
        camera = make_camera(width_px, width_px, fov_deg)
        assert _pictured_w_m2(view, camera) == expected, width_px


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("altitude_m", FIELDS)
def test_the_environment_map_has_the_light_of_the_pictured_earth(
    earth, make_state, altitude_m: float, sun: str
) -> None:
    """For a plate that faces the Earth."""
    view = earth.seen(_over_africa(make_state, altitude_m, sun))
    # Points of equal weight for a plate: uniform in the square of the sine and in azimuth.
    sine_squared, around = _stratified(450, 2)
    most = ((R_M + 90e3) / (R_M + altitude_m)) ** 2
    sine, phi = np.sqrt(most * sine_squared), 2 * np.pi * around
    rays = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - sine**2)], axis=-1)
    fine = np.pi * most * view.light(rays, FINE_M / altitude_m).astype(float).mean(axis=(0, 1))
    radiance = environment_map(view).radiance_rgb.astype(float)
    theta = np.linspace(0, np.pi, len(radiance) + 1)
    phi = np.clip(np.linspace(-np.pi, np.pi, radiance.shape[1] + 1), -np.pi / 2, np.pi / 2)
    # ∫ sin² θ dθ ∫ max(0, cos φ) dφ: the forward component over each pixel.
    weight = np.diff(theta / 2 - np.sin(2 * theta) / 4)[:, None] * np.diff(np.sin(phi))
    assert np.einsum("ij,ijk->k", weight, radiance) == pytest.approx(
        fine, rel=0.01, abs=5e-4 * WHITE_W_M2_SR * np.pi * most
    )
