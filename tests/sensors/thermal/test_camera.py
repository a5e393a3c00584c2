"""The thermal camera: what it sees, its detector, its readings, and faults in them."""

from dataclasses import replace

import numpy as np
import pytest

import posse_core as posse
from posse_core import InputError, Mount, Reading, StoredReading
from posse_core._geometry.raycast import RayCaster
from posse_core._model.label_line import ReadingLabels
from posse_core._sensors.thermal.background import background_w_m2_sr, earth_k
from posse_core._sensors.thermal.detector import Detector
from posse_core._sensors.thermal.options import ThermalOptions
from posse_core._sensors.thermal.planck import Band
from posse_core._sensors.thermal.thermal import ThermalCamera
from posse_core.testing import SensorConformance, scenes

LWIR = Band(8e-6, 14e-6)
SMALL = {"width_px": 64, "height_px": 48, "hfov_deg": 50}


def thermal(**keys) -> ThermalCamera:
    return ThermalCamera(ThermalOptions.model_validate({"camera": SMALL, "mode": "steady", **keys}))


class TestThermal(SensorConformance):
    def sensor(self):
        return thermal()


class TestThermalWithARollingShutter(SensorConformance):
    def sensor(self):
        camera = {**SMALL, "line_time_s": 1e-3, "distortion": (-0.1, 0.02, 0.0, 0.0, 0.0)}
        return thermal(camera=camera, psf_sigma_px=0, samples_per_axis=1, bit_depth=8, facet_m=0.2)


# --- the detector


def test_noise_is_the_netd_and_the_pattern_stays():
    """At 300 K, with its own f-number: two images differ by √2 NETD, and their mean has the pattern."""
    options = ThermalOptions(netd_k=0.05, fixed_pattern_k=0.08, bit_depth=16)
    detector = Detector(options, (400, 500), seed=3, name="heat")
    scene = np.full((400, 500), float(LWIR.radiance_w_m2_sr(np.array(300.0))), dtype=np.float32)
    images_k = []
    for number in range(2):
        dn = detector.image(scene, np.random.default_rng(number))
        images_k.append(LWIR.temperature_k(detector.gain_w_m2_sr_dn * dn + detector.offset_w_m2_sr))
    # 200 000 pixels: the standard deviation of a sample of them is right to 0.16 %; a step of DN is 5
    # mK.
    assert np.std(images_k[0] - images_k[1]) / np.sqrt(2) == pytest.approx(0.05, rel=0.01)
    covariance = np.cov(images_k[0].ravel(), images_k[1].ravel())[0, 1]
    assert np.sqrt(covariance) == pytest.approx(0.08, rel=0.01)
    assert np.mean(images_k) == pytest.approx(300.0, abs=1e-3)
    again = Detector(options, (400, 500), seed=3, name="heat").image(scene, np.random.default_rng(0))
    np.testing.assert_array_equal(again, detector.image(scene, np.random.default_rng(0)))
    other = Detector(options, (400, 500), seed=4, name="heat").image(scene, np.random.default_rng(0))
    assert not np.array_equal(again, other)


@pytest.mark.parametrize(("f_number", "factor"), [(1.0, 1.0), (1.4, 8.84 / 5), (2.0, 17 / 5)])
def test_a_smaller_aperture_has_more_noise(f_number: float, factor: float):
    detector = Detector(ThermalOptions(f_number=f_number, netd_k=0.05), (1, 1), 0, "heat")
    expected = 0.05 * factor * LWIR.slope_w_m2_sr_k(300.0)
    assert detector.noise_w_m2_sr == pytest.approx(expected, rel=1e-9)


def test_digital_numbers_span_the_range_of_temperatures():
    options = ThermalOptions(range_k=(200.0, 350.0), netd_k=0, fixed_pattern_k=0, bit_depth=14)
    detector = Detector(options, (1, 5), 0, "heat")
    scene = LWIR.radiance_w_m2_sr(np.array([[150.0, 200.0, 300.0, 350.0, 400.0]])).astype(np.float32)
    image = detector.image(scene, np.random.default_rng(0))
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image[0, [0, 1, 3, 4]], [0, 0, 16383, 16383])
    radiance = detector.gain_w_m2_sr_dn * image[0, 2] + detector.offset_w_m2_sr
    assert LWIR.temperature_k(np.array(radiance)) == pytest.approx(300.0, abs=0.01)


# --- the background


def looking(direction_eci: np.ndarray) -> np.ndarray:
    """Radiance of the background from a place 622 km above the equator, in some directions (N, 3)."""
    state = scenes.frame(t_body_cam_m=(0.0, 0.0, 10.0), sun_direction_body=(0.0, 0.6, 0.8))
    state = replace(state, r_camera_eci_m=np.array([7.0e6, 0.0, 0.0]))
    return background_w_m2_sr(direction_eci @ state.R_cam_from_eci.T, state, LWIR)


def test_the_earths_limb_is_where_a_sphere_has_it():
    """Along the equator, where the ellipsoid is a circle: arcsin(a/r) from nadir."""
    horizon = np.arcsin(6378137.0 / 7.0e6)
    angles = horizon + np.array([-1e-6, 1e-6])
    seen = looking(np.stack([-np.cos(angles), np.sin(angles), 0 * angles], axis=1))
    assert seen[0] > 10
    assert seen[1] < 1e-100


def test_the_ground_has_the_temperature_of_its_latitude():
    """Straight down is the equator. Knocke's exitance there is about 0.77 of a quarter of the Sun's
    flux: 262 W/m², a black body of 261 K."""
    nadir_k = LWIR.temperature_k(looking(np.array([[-1.0, 0.0, 0.0]])))[0]
    assert nadir_k == pytest.approx((0.77 * 1361 / 4 / 5.670374419e-8) ** 0.25, abs=0.5)
    latitudes_k = earth_k(np.sin(np.radians([-90, -45, 0, 45, 90])), 2459610.5, 1361.0)
    assert np.all((latitudes_k > 220) & (latitudes_k < 265))
    assert latitudes_k[2] == latitudes_k.max()
    assert latitudes_k[4] < latitudes_k[0]  # in January


def test_the_sun_is_a_disc_of_5772_k():
    sun = np.array([0.0, 0.6, 0.8])
    aside = np.array([0.0, 0.8, -0.6])
    radius = scenes.SUN_ANGULAR_RADIUS_RAD
    angles = radius * np.array([0.0, 0.99, 1.01])
    seen = looking(np.cos(angles)[:, None] * sun + np.sin(angles)[:, None] * aside)
    bright = float(LWIR.radiance_w_m2_sr(np.array(5772.0)))
    np.testing.assert_allclose(seen, [bright, bright, 0.0], rtol=1e-6, atol=1e-100)


# --- readings of a scenario


def opened() -> posse.Simulator:
    heat = {"type": "thermal", "camera": SMALL, "steps": 30}
    overrides = {"camera.width_px": 64, "camera.height_px": 48, "sensors.heat": heat}
    return posse.open("aqua", renderer="raster", overrides=overrides)


def read(simulator: posse.Simulator, index: int) -> Reading:
    (reading,) = simulator.frame(simulator.state(index)).readings["heat"]
    return reading


@pytest.fixture(scope="module")
def simulator():
    with opened() as simulator:
        yield simulator


@pytest.fixture(scope="module")
def lit_and_dark(simulator) -> tuple[Reading, Reading]:
    """Frames in sunlight, and in the Earth's shadow."""
    fractions = simulator.trajectory.sun_fraction_target
    dark = int(np.flatnonzero(fractions == 0)[-1])
    return read(simulator, 0), read(simulator, dark)


def test_temperatures_are_where_the_spacecraft_is(simulator, lit_and_dark):
    camera = thermal().options.camera.camera()
    state = simulator.state(0)
    view = RayCaster(posse.Scene(simulator.spacecraft, camera)).view(state.craft)
    mask = np.zeros((48, 64), dtype=np.bool_)
    mask[view.box.slices] = view.mask
    assert mask.sum() > 50
    np.testing.assert_array_equal(np.isfinite(lit_and_dark[0].arrays["temperature_k"]), mask)


def test_in_the_earths_shadow_the_spacecraft_is_colder_but_not_at_once(lit_and_dark):
    lit_k, dark_k = (np.nanmedian(reading.arrays["temperature_k"]) for reading in lit_and_dark)
    assert 180 < dark_k < lit_k < 420


def test_a_reading_is_the_same_from_a_new_simulator_in_another_order(simulator, lit_and_dark):
    with opened() as other:
        read(other, 7)
        again = read(other, 0)
    assert again.labels == lit_and_dark[0].labels
    for name, array in again.arrays.items():
        np.testing.assert_array_equal(array, lit_and_dark[0].arrays[name], name)
    np.testing.assert_array_equal(again.image, lit_and_dark[0].image)


def test_labels_turn_digital_numbers_into_radiance(lit_and_dark):
    for reading in lit_and_dark:
        radiance = reading.labels["gain_w_m2_sr_dn"] * reading.image + reading.labels["offset_w_m2_sr"]
        away = radiance - np.maximum(
            reading.arrays["radiance_w_m2_sr"], reading.labels["offset_w_m2_sr"]
        )
        sigma = np.hypot(0.05, 0.03) * LWIR.slope_w_m2_sr_k(300.0)
        assert np.abs(away).max() < 5 * sigma + reading.labels["gain_w_m2_sr_dn"]


def test_a_state_without_a_past_needs_the_steady_mode(simulator):
    state = simulator.state(0, r_rtn_m=[0.0, 20.0, 0.0])
    with pytest.raises(InputError, match="mode: steady"):
        simulator.frame(state)


# --- faults


def stored(simulator: posse.Simulator, reading: Reading) -> StoredReading:
    camera = thermal().options.camera.camera()
    craft = simulator.state(0).craft
    caster = RayCaster(posse.Scene(simulator.spacecraft, camera))
    none = (0.0, 0.0, 0.0)
    return StoredReading(
        index=0,
        labels=ReadingLabels(
            t_s=0.0,
            q_sensor_from_body=(1.0, 0.0, 0.0, 0.0),
            t_body_sensor_m=none,
            v_body_sensor_m_s=none,
            omega_body_rad_s=none,
            omega_sensor_rad_s=none,
        ),
        reading=reading,
        camera=camera,
        mount=Mount(),
        parts=tuple(part.name for part in simulator.spacecraft.parts),
        distances_m=lambda rays, origin, after_s: caster.rays(craft, rays, origin, after_s).distance_m,
    )


def changed(reading: Reading, name: str, change) -> Reading:
    array = reading.arrays[name].copy()
    return replace(reading, arrays={**reading.arrays, name: change(array)})


def test_a_right_reading_has_no_faults(simulator, lit_and_dark):
    assert list(thermal().faults(stored(simulator, lit_and_dark[0]))) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: changed(r, "temperature_k", lambda a: np.roll(a, 3, axis=1)), "on the craft"),
        (lambda r: changed(r, "temperature_k", lambda a: a * 10), "not from 2.725 to 2000 K"),
        (lambda r: changed(r, "temperature_k", lambda a: a - 1), "coldest_k is"),
        (lambda r: changed(r, "temperature_k", lambda a: a[:-1]), "temperature_k is float32 of shape"),
        (
            lambda r: changed(r, "temperature_k", lambda a: a.astype(np.float64)),
            "temperature_k is float64",
        ),
        (
            lambda r: changed(r, "brightness_temperature_k", lambda a: a + 1),
            "brightness_temperature_k is",
        ),
        (lambda r: changed(r, "radiance_w_m2_sr", lambda a: -a), "radiance_w_m2_sr is negative"),
        (lambda r: replace(r, labels={**r.labels, "gain_w_m2_sr_dn": 1.0}), "gain_w_m2_sr_dn is 1.0"),
        (lambda r: replace(r, image=r.image[::-1]), "beyond the noise"),
        (lambda r: replace(r, image=None), "the thermal image"),
    ],
)
def test_a_planted_fault_is_found(simulator, lit_and_dark, change, message: str):
    faults = list(thermal().faults(stored(simulator, change(lit_and_dark[0]))))
    assert any(message in fault for fault in faults), faults


# --- options


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"band_um": [14, 8]}, "band_um"),
        ({"range_k": [400, 200]}, "range_k"),
        ({"camera": {"preset": "speed"}}, "preset"),
        ({"parts": {"bus": {"emissivity": 0.0}}}, "emissivity"),
    ],
)
def test_options_that_make_no_sense_are_refused(keys, message: str):
    with pytest.raises(ValueError, match=message):
        ThermalOptions.model_validate(keys)


def test_the_default_camera_has_pixels_of_17_um():
    camera = ThermalOptions().camera.camera()
    assert (camera.width_px, camera.height_px) == (640, 512)
    assert camera.pixel_pitch_m == pytest.approx(17e-6)


def test_other_bodies_are_refused():
    friend = {"spacecraft": {"name": "cubesat"}, "relative": {"roe_m": [0, 30, 0, 0, 0, 0]}}
    with pytest.raises(posse.InputError, match=r"sensors\.t: .* rigid target alone"):
        posse.open(
            "aqua", renderer="raster", overrides={"sensors.t": "thermal", "bodies.friend": friend}
        )
