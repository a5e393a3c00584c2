"""The three spectral bands in which POSSE represents all light.

Blue, green and red are the adjoining intervals 400–500, 500–600 and 600–700 nm, with a flat response.
The linear RGB values of a material are its reflectances in these bands, and the panchromatic band is
their sum. The last axis of every radiance array is in the order red, green, blue.
"""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import BOLTZMANN_J_K, PLANCK_J_S, SPEED_OF_LIGHT_M_S

BAND_EDGES_M = ((600e-9, 700e-9), (500e-9, 600e-9), (400e-9, 500e-9))
BAND_CENTRES_M = tuple((low + high) / 2 for low, high in BAND_EDGES_M)
SUN_TEMPERATURE_K = 5772.0
"""Nominal solar effective temperature (IAU 2015 B3)."""

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(24)


def planck_radiance_w_m2_sr_m(
    wavelength_m: FloatArray | float, temperature_k: FloatArray | float
) -> FloatArray:
    """Spectral radiance of a black body, W m⁻² sr⁻¹ per metre; shapes broadcast."""
    x = PLANCK_J_S * SPEED_OF_LIGHT_M_S / (wavelength_m * BOLTZMANN_J_K * temperature_k)
    return np.asarray(
        2 * PLANCK_J_S * SPEED_OF_LIGHT_M_S**2 / wavelength_m**5 / np.expm1(x), dtype=np.float64
    )


def band_radiance_w_m2_sr(temperature_k: float) -> FloatArray:
    """(3,) radiance of a black body in the red, green and blue band, W m⁻² sr⁻¹."""
    out = np.empty(3)
    for i, (low, high) in enumerate(BAND_EDGES_M):
        half = (high - low) / 2
        wavelength_m = (low + high) / 2 + half * _GAUSS_X
        out[i] = half * np.sum(_GAUSS_W * planck_radiance_w_m2_sr_m(wavelength_m, temperature_k))
    return out


_STEFAN_BOLTZMANN = 5.670_374_419e-8
SOLAR_BAND_FRACTIONS: FloatArray = np.array([158.768, 184.677, 186.519]) / 1366.1
"""(3,) shares of the total solar irradiance in the red, green and blue band: integrals of the measured
extraterrestrial spectrum of ASTM G173-03 (Gueymard 2004, Solar Energy 76, 423), whose total is
1366.1 W/m². A black body of 5772 K would have 3, 6 and 8 % less."""
SOLAR_BAND_FRACTIONS.setflags(write=False)


def solar_fraction_m(wavelength_m: float) -> float:
    """Share of the total solar irradiance per metre of wavelength, m⁻¹, of a black body of 5772 K: for
    wavelengths outside the three bands."""
    radiance = planck_radiance_w_m2_sr_m(np.array(wavelength_m), SUN_TEMPERATURE_K)
    return float(radiance * np.pi / (_STEFAN_BOLTZMANN * SUN_TEMPERATURE_K**4))
