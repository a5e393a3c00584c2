"""Auto-exposure: the exposure time that follows from a frame's own light."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.light import Light
from posse_core._model.scene import Radiance
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import AutoExposureConfig, NoiseConfig, SensorConfig

CAMERA = Camera(64, 48, 32.0, 32.0, 31.5, 23.5, 0.036 * 64 / 1280)
QUIET = NoiseConfig(shot=False, read_e=0, dark_e_s=0)
SUN_RGB = 1361.0 * SOLAR_BAND_FRACTIONS
BLACK = SkyView(None, np.empty((0, 2)), np.empty((0, 3)))


BOX = PixelBox(8, 6, 40, 30)


def plate(albedo: float, box: PixelBox = BOX) -> Radiance:
    """A plate that faces the Sun and fills a box except for its left column."""
    coverage = np.ones((box.height, box.width), dtype=np.float32)
    coverage[:, 0] = 0
    light = coverage[..., None] * (albedo * SUN_RGB / np.pi).astype(np.float32)
    return Radiance(box, light, coverage)


def sensor(**more: object) -> ImageSensor:
    return ImageSensor(SensorConfig(noise=QUIET, psf=None, **more), CAMERA)


@pytest.mark.parametrize("color", ["mono", "rgb"])
@given(albedo=st.floats(0.01, 1.0), level=st.floats(0.1, 1.0))
def test_a_plate_is_exposed_to_the_level(albedo: float, level: float, color: str) -> None:
    """Whatever its albedo, the plate gets the share ``level`` of full scale. The factor 0.9652 is that
    of a white plate at 2 ms in docs/sensor.md."""
    camera = sensor(bit_depth=16, color=color)
    exposure_s = camera.metered_s(BLACK, plate(albedo), AutoExposureConfig(level=level))
    assert exposure_s == pytest.approx(0.002 * level / (0.965228 * albedo), rel=1e-5)
    image = camera.expose(BLACK, plate(albedo), exposure_s, seed=0, index=0)
    np.testing.assert_allclose(image[6:36, 9:48], level * 65535, atol=1)


def test_the_percentile_is_that_of_the_spacecraft_and_not_of_the_sky() -> None:
    craft = plate(0.5)
    craft.radiance_rgb[:9] *= 2  # three tenths of the rows
    blinding = replace(BLACK, radiance_rgb=np.full((48, 64, 3), 1e4, dtype=np.float32))
    for percentile, albedo in ((69.0, 0.5), (71.0, 1.0)):
        rule = AutoExposureConfig(percentile=percentile, level=0.8)
        expected_s = 0.002 * 0.8 / (0.965228 * albedo)
        assert sensor().metered_s(blinding, craft, rule) == pytest.approx(expected_s, rel=1e-5)


def test_without_a_covered_pixel_the_whole_image_is_metered() -> None:
    rule = AutoExposureConfig(level=0.8)
    sky = replace(BLACK, radiance_rgb=np.broadcast_to(plate(0.5).radiance_rgb[0, 1], (48, 64, 3)))
    speck = plate(1.0, PixelBox(20, 20, 3, 1))
    speck.coverage[:] = 0.4
    for craft in (speck, None):
        exposure_s = sensor().metered_s(sky, craft, rule)
        assert exposure_s == pytest.approx(0.0016 / 0.965228 / 0.5, rel=1e-5)


def test_exposure_stays_in_its_range_and_full_well_counts_as_white() -> None:
    rule = AutoExposureConfig(shortest_s=1e-3, longest_s=0.1)
    assert sensor().metered_s(BLACK, None, rule) == 0.1
    glare = replace(BLACK, radiance_rgb=np.full((48, 64, 3), 1e6, dtype=np.float32))
    assert sensor().metered_s(glare, None, rule) == 1e-3
    small = sensor(full_well_e=1e5, gain_e_dn=1e6 / 255)
    exposure_s = small.metered_s(BLACK, plate(1.0), AutoExposureConfig(level=1.0))
    assert exposure_s == pytest.approx(0.0002 / 1.013489, rel=1e-5)


def test_stops_change_the_exposure_of_each_frame_evenly() -> None:
    """By factors whose logarithm is even between the limits, on the metered exposure too; the frame's
    index and the seed alone choose them."""
    light = Light(CAMERA, BLACK, plate(0.5))

    def stops(auto: AutoExposureConfig | None) -> list[float]:
        camera = sensor(exposure_stops=(-2, 1), auto_exposure=auto)
        base_s = 0.002 if auto is None else camera.metered_s(BLACK, plate(0.5), auto)
        shots = (camera.photograph(lambda *_: light, seed=3, index=i) for i in range(400))
        return [float(np.log2(shot.exposure_s / base_s)) for shot in shots]

    drawn = stops(None)
    assert stats.kstest(drawn, "uniform", (-2, 3)).pvalue > 1e-3
    np.testing.assert_allclose(stops(AutoExposureConfig()), drawn, atol=1e-12)


@pytest.mark.parametrize("stops", [(1, -1), (-30, 0), (0, 21)])
def test_stops_are_in_order_and_bounded(stops: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="least change"):
        SensorConfig(exposure_stops=stops)
