"""Airy and defocused spots, vignetting, blooming and hot pixels against closed forms."""

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import j0, j1

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._imaging.psf import make_psf
from posse_core._model.camera import Camera
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import NoiseConfig, PsfConfig, SensorConfig

CAMERA = Camera(65, 49, 40.0, 40.0, 32.0, 24.0, 0.036 * 65 / 1280)
EXPOSURE_S = 0.002
QUIET = NoiseConfig(shot=False, read_e=0, dark_e_s=0)
NOTHING = (np.empty((0, 2)), np.empty((0, 3)))
SHAPES = [PsfConfig(shape="airy"), PsfConfig(shape="defocus", diameter_px=5.0), PsfConfig(sigma_px=1.2)]


@functools.cache
def _sensor(config: PsfConfig, f_number: float) -> ImageSensor:
    return ImageSensor(SensorConfig(noise=QUIET, psf=config, f_number=f_number), CAMERA)


def _spot(config: PsfConfig, u: float, v: float, f_number: float = 100.0) -> np.ndarray:
    """(65, 49) shares of a star's light; f/100 gives an Airy disc of 4.8 pixels in diameter."""
    electrons = _sensor(config, f_number).mean_electrons(
        SkyView(None, np.array([[u, v]]), np.ones((1, 3))), None, EXPOSURE_S
    )[..., 0]
    return electrons.astype(float) / electrons.sum(dtype=float)


@pytest.mark.parametrize("config", SHAPES, ids=lambda c: c.shape)
@given(u=st.floats(25, 35), v=st.floats(20, 28))
def test_a_spot_is_centred_on_its_star(config: PsfConfig, u: float, v: float) -> None:
    spot = _spot(config, u, v)
    rows, columns = np.mgrid[:49, :65]
    centroid = [(spot * columns).sum(), (spot * rows).sum()]
    assert centroid == pytest.approx([u, v], abs=0.05)


@pytest.mark.parametrize("config", SHAPES, ids=lambda c: c.shape)
def test_a_psf_conserves_light(config: PsfConfig) -> None:
    random = np.random.default_rng(1)
    image = random.exponential(1.0, (49, 65, 3)).astype(np.float32)
    sky = SkyView(image, np.array([[30.3, 20.6]]), np.ones((1, 3)))
    sharp = ImageSensor(SensorConfig(psf=None, f_number=100), CAMERA).mean_electrons(
        sky, None, EXPOSURE_S
    )
    spread = ImageSensor(SensorConfig(psf=config, f_number=100), CAMERA).mean_electrons(
        sky, None, EXPOSURE_S
    )
    assert spread.sum(dtype=float) == pytest.approx(sharp.sum(dtype=float), rel=1e-3)


def test_the_airy_spot_has_rayleighs_encircled_energy() -> None:
    """Encircled energy 1 − J₀² − J₁² (Rayleigh 1881): 83.8 % within the first dark ring."""
    spot = _spot(PsfConfig(shape="airy"), 32.0, 24.0, f_number=400.0)
    pitch_m = 0.036 / 1280
    x = np.pi * np.hypot(*np.meshgrid(np.arange(65) - 32, np.arange(49) - 24)) * pitch_m / (550e-9 * 400)
    cut = np.pi * 40 * pitch_m / (550e-9 * 400)  # half the width of the window
    whole = 1 - j0(cut) ** 2 - j1(cut) ** 2
    for ring in (3.8317, 7.0156):
        expected = (1 - j0(ring) ** 2 - j1(ring) ** 2) / whole
        assert spot[x <= ring].sum() == pytest.approx(expected, abs=0.03)


def test_a_defocused_star_is_a_uniform_disc() -> None:
    spot = _spot(PsfConfig(shape="defocus", diameter_px=9.0), 32.0, 24.0)
    distance = np.hypot(*np.meshgrid(np.arange(65) - 32, np.arange(49) - 24))
    assert spot[distance < 3.5] == pytest.approx(1 / (np.pi * 4.5**2), rel=0.01)
    assert spot[distance > 5.5].sum() == 0


def test_vignetting_is_cos4_for_extended_light_and_stars_alike() -> None:
    """Uniform radiance falls off as cos⁴. A small source gives E A cos θ, as does a star of the same
    irradiance."""
    sensor = ImageSensor(SensorConfig(noise=QUIET, psf=None, vignetting="cos4"), CAMERA)
    flat = sensor.mean_electrons(SkyView(np.ones((49, 65, 3), np.float32), *NOTHING), None, EXPOSURE_S)[
        ..., 0
    ]
    assert flat[0, 0] / flat[24, 32] == pytest.approx((1 + (32**2 + 24**2) / 40**2) ** -2, rel=1e-5)
    patch = np.zeros((49, 65, 3), np.float32)
    patch[4, 60] = 1.0
    cosine = (1 + ((60 - 32) ** 2 + (4 - 24) ** 2) / 40**2) ** -0.5
    star = SkyView(None, np.array([[60.0, 4.0]]), np.full((1, 3), cosine**3 / 40**2))
    by_patch = sensor.mean_electrons(SkyView(patch, *NOTHING), None, EXPOSURE_S).sum()
    assert sensor.mean_electrons(star, None, EXPOSURE_S).sum() == pytest.approx(by_patch, rel=1e-5)


def test_blooming_spreads_along_the_column_and_conserves_charge() -> None:
    image = np.zeros((49, 65, 3), np.float32)
    image[20, 30] = 400.0
    noise = NoiseConfig(shot=False, read_e=0, dark_e_s=0)
    common = {"noise": noise, "psf": None, "bit_depth": 16, "full_well_e": 65535.0, "f_number": 60.0}
    sky = SkyView(image, *NOTHING)
    mean = (
        ImageSensor(SensorConfig(**common), CAMERA)
        .mean_electrons(sky, None, EXPOSURE_S)
        .sum(dtype=float)
    )
    bloomed = (
        ImageSensor(SensorConfig(blooming=True, **common), CAMERA)
        .expose(sky, None, EXPOSURE_S, 0, 0)
        .astype(float)
    )
    assert mean > 5 * 65535
    assert bloomed.sum() == pytest.approx(mean, rel=1e-4)
    rows, columns = np.nonzero(bloomed)
    assert set(columns) == {30}
    assert rows.mean() == pytest.approx(20, abs=0.5)
    cut = ImageSensor(SensorConfig(**common), CAMERA).expose(sky, None, EXPOSURE_S, 0, 0)
    assert cut.sum() == 65535


def test_hot_pixels_are_the_same_in_all_frames_of_a_seed() -> None:
    noise = NoiseConfig(hot_pixels=0.01, hot_e_s=1e8, read_e=0, dark_e_s=0)
    sensor = ImageSensor(SensorConfig(noise=noise, bit_depth=16), CAMERA)
    dark = SkyView(None, *NOTHING)
    hot = [
        sensor.expose(dark, None, EXPOSURE_S, seed, index) > 0
        for seed, index in ((0, 0), (0, 7), (1, 0))
    ]
    assert hot[0].sum() == round(0.01 * 49 * 65)
    np.testing.assert_array_equal(hot[0], hot[1])
    assert (hot[0] != hot[2]).any()


def test_each_psf_shape_is_made_from_its_own_key() -> None:
    wide = make_psf(PsfConfig(shape="airy"), 32.0, 3.45e-6)
    narrow = make_psf(PsfConfig(shape="airy"), 4.0, 3.45e-6)
    assert wide.radius_px > narrow.radius_px
    assert make_psf(None, 4.0, 3.45e-6).radius_px == 0
