"""Thermal radiation of a black body in a band of wavelengths, and temperatures from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._model.bands import planck_radiance_w_m2_sr_m

STEFAN_BOLTZMANN_W_M2_K4 = 5.670_374_419e-8
"""CODATA 2018."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
SPACE_K = 2.725
"""Temperature of the cosmic background (Fixsen 2009, ApJ 707, 916)."""
_HOTTEST_K = 20_000.0


@dataclass(frozen=True)
class Band:
    """A band of wavelengths in which a detector responds evenly.

    Attributes:
        low_m, high_m: its edges.
    """

    low_m: float
    high_m: float

    def radiance_w_m2_sr(self, temperature_k: FloatArray) -> FloatArray:
        """Radiance of a black body in the band, W m⁻² sr⁻¹: (...) temperatures above 0 → (...).

        Planck's law is integrated by 48 nodes of Gauss and Legendre over the logarithm of the
        wavelength.
        """
        half = np.log(self.high_m / self.low_m) / 2
        wavelength_m = np.sqrt(self.low_m * self.high_m) * np.exp(half * _NODES)
        total = np.zeros(np.shape(temperature_k))
        with np.errstate(over="ignore"):  # a cold body's short waves: e^x is infinite, and 1 / it is 0
            for node_m, weight in zip(wavelength_m, half * _WEIGHTS, strict=True):
                spectral = planck_radiance_w_m2_sr_m(node_m, np.asarray(temperature_k))
                total += weight * node_m * spectral
        return total

    def share(self, temperature_k: float) -> float:
        """Share of a black body's whole radiation that is in the band."""
        total_w_m2_sr = STEFAN_BOLTZMANN_W_M2_K4 * temperature_k**4 / np.pi
        return float(self.radiance_w_m2_sr(np.array(temperature_k))) / total_w_m2_sr

    def slope_w_m2_sr_k(self, temperature_k: float) -> float:
        """Change of a black body's radiance in the band with its temperature, W m⁻² sr⁻¹ K⁻¹."""
        around_k = np.array([temperature_k - 0.05, temperature_k + 0.05])
        low, high = self.radiance_w_m2_sr(around_k)
        return float((high - low) / 0.1)

    def temperature_k(self, radiance_w_m2_sr: FloatArray | Float32Array) -> FloatArray:
        """Temperature of the black body that has a radiance in the band: (...) → (...).

        It is interpolated in a table to 0.1 mK between 50 K and 1500 K; radiance that is not positive,
        or beyond the table, gives its coldest (1 K) or hottest (20 000 K) temperature.
        """
        log_radiance, inverse_k = self._table
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.log(np.maximum(np.asarray(radiance_w_m2_sr, dtype=np.float64), 0.0))
        return np.asarray(1 / np.interp(at, log_radiance, inverse_k))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Logarithms of radiances, ascending, and the inverse temperatures, which are almost linear in
        them."""
        inverse_k = np.geomspace(1 / SPACE_K, 1 / _HOTTEST_K, 16_000)
        radiance = self.radiance_w_m2_sr(1 / inverse_k)
        seen = radiance > 0
        return np.log(radiance[seen]), inverse_k[seen]
