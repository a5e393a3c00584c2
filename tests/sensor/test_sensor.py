"""The sensor against closed forms: plate, star, photon transfer, conservation of light."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._errors import ComponentError
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.scene import Radiance
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import NoiseConfig, PsfConfig, SensorConfig

CAMERA = Camera(64, 48, 32.0, 32.0, 31.5, 23.5, 0.036 * 64 / 1280)
EXPOSURE_S = 0.002
QUIET = NoiseConfig(shot=False, read_e=0, dark_e_s=0)
SUN_RGB = 1361.0 * SOLAR_BAND_FRACTIONS
NO_POINTS = (np.empty((0, 2)), np.empty((0, 3)))
HC = 6.62607015e-34 * 299792458.0


def _flat(rgb) -> SkyView:
    image = np.broadcast_to(np.asarray(rgb, dtype=np.float32), (48, 64, 3)).copy()
    return SkyView(image, *NO_POINTS)


def _plate_electrons(albedo: float, config: SensorConfig) -> float:
    """E A t λ QE / (4 N² h c), summed over the bands; the radiance of the plate is albedo E / π."""
    bands = np.array([650e-9, 550e-9, 450e-9])
    area_m2 = (0.036 / 1280) ** 2
    photons = albedo * SUN_RGB * area_m2 * EXPOSURE_S * bands / HC / (4 * config.f_number**2)
    return float(np.sum(photons * np.array(config.quantum_efficiency)))


@pytest.mark.parametrize("color", ["mono", "rgb"])
@pytest.mark.parametrize("albedo", [0.18, 0.5, 1.0])
def test_a_white_plate_has_the_documented_dn(albedo: float, color: str) -> None:
    config = SensorConfig(noise=QUIET, bit_depth=16, color=color)
    image = ImageSensor(config, CAMERA).expose(
        _flat(albedo * SUN_RGB / np.pi), None, EXPOSURE_S, seed=0, index=0
    )
    expected = 65535 * _plate_electrons(albedo, config) / 1.05e6
    assert image.shape == ((48, 64) if color == "mono" else (48, 64, 3))
    np.testing.assert_allclose(image, expected, atol=1.0)


def test_a_smaller_image_of_the_same_sensor_is_as_bright() -> None:
    coarse = replace(CAMERA, sensor_width_m=4 * CAMERA.sensor_width_m)  # pixels of four times the width
    config = SensorConfig(noise=QUIET, bit_depth=16)
    images = [
        ImageSensor(config, c).expose(_flat(SUN_RGB / np.pi), None, EXPOSURE_S, 0, 0)
        for c in (CAMERA, coarse)
    ]
    np.testing.assert_allclose(images[0], images[1], atol=1)


def test_the_defaults_expose_white_just_below_saturation() -> None:
    image = ImageSensor(SensorConfig(noise=QUIET), CAMERA).expose(
        _flat(SUN_RGB / np.pi), None, EXPOSURE_S, 0, 0
    )
    assert image.dtype == np.uint8
    assert 235 <= image.min() <= image.max() <= 250
    half = ImageSensor(SensorConfig(noise=QUIET), CAMERA).expose(
        _flat(0.5 * SUN_RGB / np.pi), None, EXPOSURE_S, 0, 0
    )
    assert np.unique(half) == [123]  # the value in docs/sensor.md


@pytest.mark.parametrize("psf", [None, PsfConfig(sigma_px=0.5), PsfConfig(sigma_px=1.7)])
@pytest.mark.parametrize("position", [(20.0, 20.0), (20.5, 19.75), (31.23, 24.49)])
def test_a_star_gives_its_flux_at_its_position(psf, position) -> None:
    irradiance = np.array([[3e-5, 2e-5, 1e-5]])
    config = SensorConfig(noise=QUIET, psf=psf)
    sky = SkyView(None, np.array([position]), irradiance)
    electrons = ImageSensor(config, CAMERA).mean_electrons(sky, None, EXPOSURE_S)[..., 0].astype(float)
    aperture_m2 = np.pi / 4 * (32 * 0.036 / 1280 / config.f_number) ** 2
    bands = np.array([650e-9, 550e-9, 450e-9])
    expected = np.sum(irradiance * aperture_m2 * EXPOSURE_S * bands / HC * config.quantum_efficiency)
    assert electrons.sum() == pytest.approx(expected, rel=1e-4)
    if psf is not None:
        v, u = np.mgrid[:48, :64]
        centroid = np.array([(u * electrons).sum(), (v * electrons).sum()]) / electrons.sum()
        assert centroid == pytest.approx(position, abs=0.01)


def test_extended_and_point_light_agree_on_the_axis() -> None:
    """A star of irradiance L dΩ gives as many electrons as one pixel of radiance L."""
    camera = Camera(65, 49, 320.0, 320.0, 32.0, 24.0, 0.036)
    sensor = ImageSensor(SensorConfig(noise=QUIET), camera)
    image = np.zeros((49, 65, 3), dtype=np.float32)
    image[24, 32] = (1.0, 2.0, 3.0)
    star = SkyView(None, np.array([[32.0, 24.0]]), np.array([[1.0, 2.0, 3.0]]) / 320.0**2)
    extended = sensor.mean_electrons(SkyView(image, *NO_POINTS), None, EXPOSURE_S).sum(dtype=float)
    assert sensor.mean_electrons(star, None, EXPOSURE_S).sum(dtype=float) == pytest.approx(
        extended, rel=1e-4
    )


@given(st.integers(0, 2**31), st.floats(0.3, 4.0))
def test_blurring_conserves_light(seed: int, sigma_px: float) -> None:
    random = np.random.default_rng(seed)
    image = random.exponential(1.0, (48, 64, 3)).astype(np.float32)
    image[0, 0] = image[47, 30] = 1e4
    sky = SkyView(image, *NO_POINTS)
    blurred = ImageSensor(SensorConfig(psf=PsfConfig(sigma_px=sigma_px)), CAMERA).mean_electrons(
        sky, None, EXPOSURE_S
    )
    sharp = ImageSensor(SensorConfig(psf=None), CAMERA).mean_electrons(sky, None, EXPOSURE_S)
    assert blurred.sum(dtype=float) == pytest.approx(sharp.sum(dtype=float), rel=1e-4)


@given(
    mean_dn=st.floats(100, 40000),
    gain_e_dn=st.floats(0.2, 20),
    read_e=st.floats(0, 40),
    gaussian_dn=st.floats(0, 30),
    seed=st.integers(0, 2**31),
)
def test_photon_transfer_curve(mean_dn, gain_e_dn, read_e, gaussian_dn, seed) -> None:
    """Janesick (2007): mean = S/K, variance = S/K² + r²/K² + g² + 1/12, in DN."""
    noise = NoiseConfig(shot=True, read_e=read_e, dark_e_s=100, gaussian_dn=gaussian_dn)
    config = SensorConfig(
        bit_depth=16, gain_e_dn=gain_e_dn, full_well_e=1e9, offset_dn=1000, noise=noise, psf=None
    )
    electrons = mean_dn * gain_e_dn
    albedo = (electrons - 100 * 0.002) / _plate_electrons(1.0, config)
    sensor = ImageSensor(config, Camera(320, 240, 32.0, 32.0, 31.5, 23.5, 0.036 * 320 / 1280))
    flat = np.broadcast_to((albedo * SUN_RGB / np.pi).astype(np.float32), (240, 320, 3))
    image = sensor.expose(SkyView(flat, *NO_POINTS), None, EXPOSURE_S, seed, 0).astype(float)
    variance = (electrons + read_e**2) / gain_e_dn**2 + gaussian_dn**2 + 1 / 12
    # Five standard errors of the mean and of the variance of 76,800 draws, and float32's rounding.
    assert image.mean() - 1000 == pytest.approx(
        mean_dn, abs=5 * np.sqrt(variance / image.size) + 1e-5 * mean_dn
    )
    assert image.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / image.size) + 0.003)


@pytest.mark.parametrize("mean_e", [0.05, 1.0, 20.0, 63.0, 65.0])
def test_small_signals_are_poisson_distributed(mean_e: float) -> None:
    """The third central moment of a Poisson variable is its mean."""
    config = SensorConfig(
        gain_e_dn=1.0, psf=None, bit_depth=16, noise=NoiseConfig(read_e=0, dark_e_s=mean_e / 0.002)
    )
    sky = SkyView(None, *NO_POINTS)
    frames = [ImageSensor(config, CAMERA).expose(sky, None, EXPOSURE_S, 1, index) for index in range(40)]
    counts = np.stack(frames).astype(float)
    n = counts.size
    assert counts.mean() == pytest.approx(mean_e, abs=5 * np.sqrt(mean_e / n))
    # Below the switch to a Gaussian, quantisation adds no variance; above it, 1/12.
    variance = mean_e + (1 / 12 if mean_e > 64 else 0)
    assert counts.var() == pytest.approx(variance, rel=5 * np.sqrt((2 + 1 / mean_e) / n))


def test_full_well_and_bit_depth_limit_the_image() -> None:
    bright = _flat(100 * SUN_RGB)
    assert (ImageSensor(SensorConfig(), CAMERA).expose(bright, None, EXPOSURE_S, 0, 0) >= 254).all()
    low = SensorConfig(full_well_e=1000, gain_e_dn=10, noise=QUIET)
    assert (ImageSensor(low, CAMERA).expose(bright, None, EXPOSURE_S, 0, 0) == 100).all()
    assert (
        ImageSensor(SensorConfig(), CAMERA).expose(SkyView(None, *NO_POINTS), None, EXPOSURE_S, 0, 0)
        <= 1
    ).all()


def test_the_spacecraft_hides_sky_and_stars() -> None:
    box = PixelBox(10, 8, 20, 16)
    coverage = np.zeros((16, 20), dtype=np.float32)
    coverage[:, 10:] = 1.0
    coverage[:, 9] = 0.5
    craft = Radiance(box, coverage[..., None] * np.float32([3.0, 3.0, 3.0]), coverage)
    sky = _flat((1.0, 1.0, 1.0))
    sensor = ImageSensor(SensorConfig(noise=QUIET, psf=None), CAMERA)
    electrons = sensor.mean_electrons(sky, craft, EXPOSURE_S)[..., 0]
    unit = electrons[0, 0]
    np.testing.assert_allclose(electrons[8:24, 10:19], unit, rtol=1e-5)
    np.testing.assert_allclose(electrons[8:24, 19], 2 * unit, rtol=1e-5)
    np.testing.assert_allclose(electrons[8:24, 20:30], 3 * unit, rtol=1e-5)
    np.testing.assert_allclose(electrons[24:], unit, rtol=1e-5)
    stars = np.array([[12.0, 10.0], [19.2, 10.0], [25.0, 10.0], [50.0, 40.0]])
    points = sensor.mean_electrons(
        SkyView(None, stars, np.ones((4, 3))),
        Radiance(box, 0 * craft.radiance_rgb, coverage),
        EXPOSURE_S,
    )
    open_sky = points[40, 50, 0]
    assert open_sky > 0
    assert points[10, [12, 19, 25], 0] == pytest.approx([open_sky, 0.5 * open_sky, 0.0])


@given(seed=st.integers(0, 2**31), index=st.integers(0, 10**6))
def test_noise_depends_on_seed_and_index_alone(seed: int, index: int) -> None:
    config = SensorConfig(bit_depth=16, color="rgb")
    sky = SkyView(_flat(0.3 * SUN_RGB).radiance_rgb, np.array([[5.3, 60.2]]), np.ones((1, 3)))
    first = ImageSensor(config, CAMERA).expose(sky, None, EXPOSURE_S, seed, index)
    np.testing.assert_array_equal(
        first, ImageSensor(config, CAMERA).expose(sky, None, EXPOSURE_S, seed, index)
    )
    assert (first != ImageSensor(config, CAMERA).expose(sky, None, EXPOSURE_S, seed, index + 1)).any()
    assert (first != ImageSensor(config, CAMERA).expose(sky, None, EXPOSURE_S, seed + 1, index)).any()


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_radiance_that_is_negative_or_not_finite_is_an_error(value: float) -> None:
    box = PixelBox(0, 0, 4, 4)
    light = np.ones((4, 4, 3), dtype=np.float32)
    light[2, 1, 0] = value
    craft = Radiance(box, light, np.ones((4, 4), dtype=np.float32))
    with pytest.raises(ComponentError, match="negative or not finite"):
        ImageSensor(SensorConfig(), CAMERA).expose(SkyView(None, *NO_POINTS), craft, EXPOSURE_S, 0, 0)


def test_the_srgb_response_is_the_standards_curve() -> None:
    """IEC 61966-2-1: a linear share of 0.2140 has the code 0.5; 0.0025 is on the linear part."""
    for share, coded in ((0.21404, 0.5), (0.0025, 0.0323), (2.0, 1.0)):
        light = share / 0.965228 * SUN_RGB / np.pi
        config = SensorConfig(noise=QUIET, response="srgb", bit_depth=16)
        image = ImageSensor(config, CAMERA).expose(_flat(light), None, EXPOSURE_S, 0, 0)
        np.testing.assert_allclose(image / 65535, coded, atol=1e-4)
