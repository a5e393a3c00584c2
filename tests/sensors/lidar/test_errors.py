"""Random errors: means, variances and probabilities over many beams against their laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.constants import c, h, k
from scipy.stats import norm

from posse_core._model.spacecraft import Material
from posse_core.testing import scenes

MATT = Material("matt", (0.4, 0.3, 0.2), specular=0.0)
BEAMS = 40_000
SIGMA_BOUND = 4.5
"""Of a mean or a variance that is drawn, in its own standard deviations: 7 in a million are beyond."""


@pytest.fixture
def many(sense):
    """Returns a function that sends the same beam 40 000 times: (N,) arrays, the labels, and the
    expected signal in electrons."""

    def send(
        *, energy_j=1e-9, noise=None, receiver=None, pattern=None, parts=(), distance_m=20.0, **more
    ):
        wall = scenes.rectangle("wall", "matt", u_m=(9, 0, 0), v_m=(0, 9, 0))
        options = {
            "pattern": {
                "shape": "raster",
                "rays": 1,
                "columns": 200,
                "rows": 200,
                "width_deg": 1e-6,
                "height_deg": 1e-6,
                "pulse_energy_j": energy_j,
                **(pattern or {}),
            },
            "receiver": {"saturation_e": None, **(receiver or {})},
            "noise": {"shot": True, "receiver_e": 20.0, "range_m": 0.0, **(noise or {})},
        }
        reading = sense([wall, *parts], options, t_m=(0, 0, distance_m), **more)
        expected_e = energy_j * 0.7 * 0.7 * 1.55e-6 / (h * c) * 0.4 * 0.02**2 / (4 * distance_m**2)
        return reading.arrays, reading.labels, expected_e

    return send


def assert_mean(values, mean, sigma):
    assert abs(values.mean() - mean) < SIGMA_BOUND * sigma / math.sqrt(len(values))


def assert_variance(values, variance):
    """Of nearly Gaussian values."""
    assert abs(values.var() / variance - 1) < SIGMA_BOUND * math.sqrt(2 / len(values))


def test_the_signal_has_photon_noise_and_the_receivers(many):
    arrays, _, signal = many(energy_j=4e-8)
    assert signal > 5_000
    assert_mean(arrays["intensity_e"], signal, math.sqrt(signal + 400))
    assert_variance(arrays["intensity_e"], signal + 400)


def test_without_photon_noise_the_receivers_remains(many):
    arrays, _, signal = many(energy_j=4e-8, noise={"shot": False})
    assert_mean(arrays["intensity_e"], signal, 20)
    assert_variance(arrays["intensity_e"], 400)


@pytest.mark.parametrize("energy_j", [2e-8, 4e-7, 4e-6])
def test_ranges_scatter_by_the_signal_to_noise_ratio(many, energy_j):
    """σ = c t_rise / (2 SNR), the rise being that of a Gaussian pulse from 10 to 90 %."""
    arrays, _, signal = many(
        energy_j=energy_j, noise={"receiver_e": 5.0}, receiver={"threshold_snr": 0.5}
    )
    width_s = 3e-9
    pulse_sigma_s = width_s / (2 * math.sqrt(2 * math.log(2)))
    rise_s = pulse_sigma_s * (math.sqrt(2 * math.log(10)) - math.sqrt(2 * math.log(10 / 9)))
    sigma_m = c * rise_s / 2 * math.sqrt(signal + 25) / signal
    error_m = (arrays["range_m"] - arrays["true_range_m"])[arrays["part_id"] >= 0]
    assert len(error_m) > 0.99 * BEAMS
    assert_mean(error_m, 0, sigma_m)
    assert_variance(error_m, sigma_m**2)


def test_the_constant_part_and_the_bias(many):
    """The constant part adds to the variance that the signal causes."""
    arrays, _, _ = many(energy_j=1e-2, noise={"range_m": 0.05})
    error_m = arrays["range_m"] - arrays["true_range_m"]
    assert_mean(error_m, 0, 0.05)
    assert_variance(error_m, 0.05**2)


def test_an_oblique_surface_lengthens_the_pulse(sense):
    """A Gaussian beam on a wall at 60° has ranges with σ = R (θ/4) tan 60°, which add to the pulse."""
    wall = scenes.rectangle("wall", "matt", u_m=(60, 0, 0), v_m=(0, 60, 0))
    tilt, distance_m, theta = math.radians(60), 40.0, 0.02
    R = np.array([[math.cos(tilt), 0, math.sin(tilt)], [0, 1, 0], [-math.sin(tilt), 0, math.cos(tilt)]])
    options = {
        "pattern": {"shape": "raster", "rays": 60, "columns": 100, "rows": 100, "width_deg": 1e-6,
                    "height_deg": 1e-6, "divergence_rad": theta, "pulse_energy_j": 4e-5},
        "ranging": {"echo": "centroid"},
        "receiver": {"saturation_e": None},
        "noise": {"shot": True, "receiver_e": 0.0, "range_m": 0.0},
    }  # fmt: skip
    arrays = sense([wall], options, t_m=(0, 0, distance_m), R_cam_from_body=R @ scenes.FACING).arrays
    signal = 4e-5 * 0.49 * 1.55e-6 / (h * c) * 0.4 * math.cos(tilt) * 0.02**2 / (4 * distance_m**2)
    spread_s = 2 / c * distance_m * theta / 4 * math.tan(tilt)
    pulse_s = 3e-9 / (2 * math.sqrt(2 * math.log(2)))
    rise = math.sqrt(2 * math.log(10)) - math.sqrt(2 * math.log(10 / 9))
    sigma_m = c / 2 * rise * math.hypot(pulse_s, spread_s) / math.sqrt(signal)
    assert spread_s > pulse_s
    assert arrays["range_m"].std() == pytest.approx(sigma_m, rel=0.06)


@pytest.mark.parametrize("sigmas", [-2.0, -0.5, 0.0, 1.5])
def test_how_often_a_weak_signal_is_detected(many, sigmas):
    """A Gaussian signal that lies so many of its standard deviations above the threshold."""
    noise = {"receiver_e": 1000.0, "shot": False}
    unit = many(energy_j=1e-6)[2]
    energy_j = 1e-6 * (6 + sigmas) * 1000 / unit
    arrays, labels, signal = many(energy_j=energy_j, noise=noise)
    assert signal == pytest.approx((6 + sigmas) * 1000)
    share = norm.cdf(sigmas)
    assert abs(labels["returns"] / BEAMS - share) < SIGMA_BOUND * math.sqrt(share * (1 - share) / BEAMS)
    assert labels["drop_outs"] == BEAMS - labels["returns"]
    assert np.isfinite(arrays["range_m"]).sum() == labels["returns"]
    assert np.nanmin(arrays["intensity_e"]) >= 6000
    assert np.isfinite(arrays["true_range_m"]).all()


def test_saturation_limits_the_signal(many):
    arrays, labels, signal = many(energy_j=1.3e-8, receiver={"saturation_e": 5_000})
    assert 4_900 < signal < 5_000
    share = norm.cdf((signal - 5000) / math.sqrt(signal + 400))
    assert abs(labels["saturated"] / BEAMS - share) < SIGMA_BOUND * math.sqrt(share / BEAMS)
    assert (arrays["intensity_e"] <= 5000).all()
    assert (arrays["saturated"] == (arrays["intensity_e"] == 5000)).all()


SUNNY = {"pattern": {"field_of_view_rad": 0.05}, "receiver": {"bandwidth_m": 1e-7}}


def sunlight_e(cosine, seen_rad=0.05, bandwidth_m=1e-7):
    """Electrons of sunlight from a Lambertian plate, by Planck's law for 5772 K."""
    wavelength = 1.55e-6
    planck = 2 * h * c**2 / wavelength**5 / math.expm1(h * c / (wavelength * k * 5772))
    stefan_boltzmann = 5.670374419e-8
    irradiance_m = 1361 * math.pi * planck / (stefan_boltzmann * 5772**4)
    radiance_m = 0.4 / math.pi * irradiance_m * cosine
    etendue = math.pi / 4 * 0.02**2 * math.pi / 4 * seen_rad**2
    return radiance_m * bandwidth_m * etendue * 3e-9 * 0.49 * wavelength / (h * c)


def test_sunlight_adds_its_photon_noise(many):
    arrays, _, signal = many(energy_j=4e-8, sun_body=(0.6, 0.0, 0.8), **SUNNY)
    background = sunlight_e(0.8)
    assert background > 0.5 * signal
    assert_mean(arrays["intensity_e"], signal, math.sqrt(signal + background + 400))
    assert_variance(arrays["intensity_e"], signal + background + 400)


@pytest.mark.parametrize(
    "dark", [{"sun_body": (0.6, 0.0, -0.8)}, {"sun_body": (0.6, 0, 0.8), "sun_fraction": 0.0}]
)
def test_there_is_no_sunlight_behind_the_surface_and_in_eclipse(many, dark):
    arrays, _, signal = many(energy_j=4e-8, **dark, **SUNNY)
    assert_variance(arrays["intensity_e"], signal + 400)


def test_there_is_no_sunlight_in_the_shadow_of_a_part(many):
    """A plate beside the beam, towards the Sun."""
    shade = scenes.rectangle("shade", "matt", centre_m=(6, 0, 8), u_m=(1, 0, 0), v_m=(0, 1, 0))
    for parts, background in (([shade], 0.0), ([], sunlight_e(0.8))):
        arrays, _, signal = many(energy_j=4e-8, sun_body=(0.6, 0.0, 0.8), parts=parts, **SUNNY)
        assert_variance(arrays["intensity_e"], signal + background + 400)


def test_the_sun_stands_still_while_the_sensor_turns(sense, tmp_path):
    """Beams 2 s later, aimed at where the wall is then: it is as sunlit as before."""
    turned = 2 * 0.2
    axis = np.tile([-math.sin(turned), 0, math.cos(turned)], (BEAMS, 1))
    np.savez(tmp_path / "beams.npz", t_s=np.full(BEAMS, 2.0), r_beam=axis)
    pattern = {
        "shape": "given",
        "path": tmp_path / "beams.npz",
        "pulse_energy_j": 4e-8,
        "rays": 1,
        "field_of_view_rad": 0.05,
    }
    wall = scenes.rectangle("wall", "matt", u_m=(9, 0, 0), v_m=(0, 9, 0))
    options = {
        "pattern": pattern,
        "receiver": {"saturation_e": None, **SUNNY["receiver"]},
        "noise": {"receiver_e": 20.0},
    }
    rates = ((0, 0, 0), (0, 0, 0), (0, 0.2, 0))
    reading = sense([wall], options, t_m=(0, 0, 20), sun_body=(0.6, 0, 0.8), rates=rates)
    expected_e = 4e-8 * 0.49 * 1.55e-6 / (h * c) * 0.4 * 0.02**2 / (4 * 20**2)
    np.testing.assert_allclose(reading.arrays["true_range_m"], 20, atol=1e-9)
    assert_variance(reading.arrays["intensity_e"], expected_e + sunlight_e(0.8) + 400)


def test_sunlight_raises_the_threshold(many):
    """A signal of 6 σ without sunlight is seldom detected in it."""
    unit = many(energy_j=1e-6)[2]
    energy_j = 1e-6 * 200 / unit
    shares = [
        many(energy_j=energy_j, sun_body=(0.6, 0, z), **SUNNY)[1]["returns"] / BEAMS for z in (-0.8, 0.8)
    ]
    assert shares[0] > 0.99
    threshold = 6 * math.sqrt(sunlight_e(0.8) + 400)
    expected = norm.cdf((200 - threshold) / math.sqrt(200 + sunlight_e(0.8) + 400))
    assert shares[1] == pytest.approx(expected, abs=0.01)


def test_frames_have_errors_of_their_own(many):
    one, again, other = (many(energy_j=4e-8, index=i)[0]["range_m"] for i in (0, 0, 1))
    np.testing.assert_array_equal(one, again)
    assert abs(np.corrcoef(one, other)[0, 1]) < SIGMA_BOUND / math.sqrt(BEAMS)


def positive(low, high):
    return st.floats(math.log(low), math.log(high)).map(lambda x: min(max(math.exp(x), low), high))


@given(
    st.fixed_dictionaries(
        {
            "pattern": st.fixed_dictionaries(
                {
                    "shape": st.just("raster"),
                    "columns": st.just(5),
                    "rows": st.just(4),
                    "rays": st.integers(1, 9),
                    "pulse_energy_j": positive(1e-30, 100),
                    "divergence_rad": st.just(0.0) | positive(1e-12, 0.2),
                }
            ),
            "wavelength_m": positive(2e-7, 2e-5),
            "pulse_width_s": positive(1e-20, 1e-6),
            "receiver": st.fixed_dictionaries(
                {
                    "aperture_m": positive(1e-9, 10),
                    "bandwidth_m": st.just(0.0) | positive(1e-20, 1e-6),
                    "threshold_snr": positive(1e-9, 1e6),
                    "efficiency": st.floats(0, 1),
                }
            ),
            "ranging": st.fixed_dictionaries(
                {"echo": st.sampled_from(["first", "strongest", "centroid"])}
            ),
            "noise": st.fixed_dictionaries(
                {
                    "shot": st.booleans(),
                    "receiver_e": st.just(0.0) | positive(1e-9, 1e9),
                    "range_m": st.just(0.0) | positive(1e-9, 1e3),
                }
            ),
        }
    ),
    positive(0.1, 1e5),
    st.sampled_from([MATT, Material("matt", metallic=1.0, roughness=0.0), Material("matt", (0, 0, 0))]),
)
def test_any_lidar_measures_finite_numbers_or_nothing(sense, options, distance_m, material):
    wall = scenes.rectangle("wall", "matt", u_m=(distance_m / 9, 0, 0), v_m=(0, distance_m / 9, 0))
    options = {**options, "formats": ["ply", "las"]}
    reading = sense(
        [wall], options, t_m=(0, 0, distance_m), sun_body=(0.1, 0.2, 1), materials=(material,)
    )
    detected = reading.arrays["part_id"] >= 0
    for name in ("range_m", "intensity_e"):
        assert (np.isfinite(reading.arrays[name]) == detected).all()
    assert reading.labels["returns"] + reading.labels["drop_outs"] <= reading.labels["beams"] == 20
