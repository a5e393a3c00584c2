"""Radiation in a band: against quadrature, published tables and its own inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.constants import Boltzmann, Planck, speed_of_light
from scipy.integrate import quad

from posse_core._sensors.thermal.planck import STEFAN_BOLTZMANN_W_M2_K4, Band

LWIR = Band(8e-6, 14e-6)


def by_quadrature(low_m: float, high_m: float, temperature_k: float) -> float:
    def spectral(wavelength_m: float) -> float:
        x = Planck * speed_of_light / (wavelength_m * Boltzmann * temperature_k)
        return 2 * Planck * speed_of_light**2 / wavelength_m**5 / np.expm1(x)

    # In micrometres, so that the quadrature's absolute tolerance means nothing.
    return (
        1e-6 * quad(lambda um: spectral(1e-6 * um), 1e6 * low_m, 1e6 * high_m, epsabs=0, epsrel=1e-12)[0]
    )


@pytest.mark.parametrize("temperature_k", [30.0, 77.0, 150.0, 300.0, 600.0, 5772.0])
@pytest.mark.parametrize(
    ("low_m", "high_m"), [(8e-6, 14e-6), (7.5e-6, 13.5e-6), (3e-6, 5e-6), (1e-6, 50e-6)]
)
def test_a_band_agrees_with_quadrature(low_m: float, high_m: float, temperature_k: float):
    exact = by_quadrature(low_m, high_m, temperature_k)
    radiance = Band(low_m, high_m).radiance_w_m2_sr(np.array(temperature_k))
    # From 1 to 50 µm a cold body's radiation varies by many orders of magnitude.
    assert float(radiance) == pytest.approx(exact, rel=1e-10 if high_m < 20e-6 else 1e-6)


# F(0 → λT), computed with the constants of 1986, of Incropera, Fundamentals of Heat and Mass Transfer,
# 6th ed. 2007, Table 12.1.
TABLE = {1600: 0.019718, 2400: 0.140256, 2800: 0.227897, 4000: 0.480877, 4200: 0.516014, 7000: 0.808109}


@pytest.mark.parametrize(
    ("temperature_k", "edges_um_k"), [(200, (1600, 2800)), (300, (2400, 4200)), (500, (4000, 7000))]
)
def test_shares_are_those_of_the_published_table(temperature_k: int, edges_um_k: tuple[int, int]):
    low, high = edges_um_k
    assert LWIR.share(temperature_k) == pytest.approx(TABLE[high] - TABLE[low], abs=3e-5)


def test_all_wavelengths_are_the_law_of_stefan_and_boltzmann():
    # Beyond 0.1 µm and 10 mm a body of 300 K has less than 1e-10 of its radiation.
    all_of_it = np.pi * sum(
        Band(low, 10 * low).radiance_w_m2_sr(np.array(300.0)) for low in 10.0 ** np.arange(-7, -1)
    )
    assert all_of_it == pytest.approx(STEFAN_BOLTZMANN_W_M2_K4 * 300.0**4, rel=1e-8)


@given(st.floats(30.0, 1500.0))
def test_temperature_is_the_inverse(temperature_k: float):
    radiance = LWIR.radiance_w_m2_sr(np.array([temperature_k]))
    assert LWIR.temperature_k(radiance)[0] == pytest.approx(temperature_k, abs=1e-4)


def test_no_radiance_is_as_cold_as_space():
    assert LWIR.temperature_k(np.array([0.0]))[0] == pytest.approx(2.725)


def test_the_slope_is_the_derivative():
    step_k = 0.01
    exact = (by_quadrature(8e-6, 14e-6, 300 + step_k) - by_quadrature(8e-6, 14e-6, 300 - step_k)) / (
        2 * step_k
    )
    assert LWIR.slope_w_m2_sr_k(300.0) == pytest.approx(exact, rel=1e-6)
