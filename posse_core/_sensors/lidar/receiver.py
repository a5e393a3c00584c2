"""From returning light to measured signals and ranges, with their random errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._constants import PLANCK_J_S, SPEED_OF_LIGHT_M_S
from posse_core._sensors.lidar.options import LidarOptions

_SIGMA_SHARE = 1 / (2 * math.sqrt(2 * math.log(2)))
"""Standard deviation of a Gaussian pulse over its full width at half its maximum."""
_RISE_SIGMAS = 1.6873
"""Time in which a Gaussian pulse rises from 10 % to 90 %, in its standard deviations: √(2 ln 10) −
√(2 ln(10/9))."""
_LEAST_THRESHOLD_E = 1.0
_MOST_POISSON = 1e18
"""Mean up to which NumPy draws Poisson variables, whose relative deviation is 10⁻⁹ there."""


@dataclass(frozen=True)
class Measured:
    """What the receiver makes of N echoes.

    Attributes:
        signal_e: (N,) measured signal, electrons.
        detected: (N,) bool.
        saturated: (N,) bool.
        range_m: (N,) measured range; NaN where nothing is detected.
    """

    signal_e: FloatArray
    detected: BoolArray
    saturated: BoolArray
    range_m: FloatArray


class Receiver:
    """A receiver's response, by the keys of the sensor."""

    def __init__(self, options: LidarOptions) -> None:
        self._options = options
        receiver = options.receiver
        self._area_m2 = math.pi / 4 * receiver.aperture_m**2
        photon_j = PLANCK_J_S * SPEED_OF_LIGHT_M_S / options.wavelength_m
        self._e_per_j = receiver.efficiency * receiver.quantum_efficiency / photon_j
        self._pulse_s = options.pulse_width_s * _SIGMA_SHARE
        self.gap_m = SPEED_OF_LIGHT_M_S * options.pulse_width_s / 2
        """Least distance between two surfaces that are told apart: half the length of the pulse."""

    def signal_e(self, energy_j: float, reflected_sr: FloatArray, range_m: FloatArray) -> FloatArray:
        """Electrons of light that is sent to surfaces and returns, any shape.

        It is the lidar equation for a surface that the light falls on as a whole: P_r = P_t f cos θ
        A η / R², which for a Lambertian surface of reflectance ρ is P_t ρ cos θ D² η / (4 R²)
        (Jelalian 1992, Laser Radar Systems, chapter 1).

        Args:
            energy_j: of the light.
            reflected_sr: f cos θ, sr⁻¹.
            range_m: distance of the surface.
        """
        return np.asarray(energy_j * self._e_per_j * self._area_m2 * reflected_sr / range_m**2)

    def background_e(self, radiance_w_m2_sr_m: FloatArray, field_sr: float) -> FloatArray:
        """Electrons of sunlight during a pulse: spectral radiance of the surface, W m⁻² sr⁻¹ per metre
        of wavelength, and the receiver's solid angle → the radiance's shape."""
        options = self._options
        taken = self._area_m2 * field_sr * options.receiver.bandwidth_m * options.pulse_width_s
        return np.asarray(radiance_w_m2_sr_m * taken * self._e_per_j)

    def threshold_e(self, background_e: FloatArray) -> FloatArray:
        """Least signal that is detected, electrons: (N,) → (N,)."""
        noise_e = np.sqrt(self._variance(background_e))
        return np.maximum(self._options.receiver.threshold_snr * noise_e, _LEAST_THRESHOLD_E)

    def sigma_m(
        self, signal_e: FloatArray, background_e: FloatArray, spread_m: FloatArray
    ) -> FloatArray:
        """Standard deviation of measured ranges (N,).

        σ = c t_rise / (2 SNR), where SNR is the signal over its noise, the root of the ratio of powers
        (Jelalian 1992, chapter 1; Baltsavias 1999, ISPRS J. 54, 199), at least 1 here, and in addition
        ``noise.range_m``.
        The rise time is that of the returning pulse, which is longer if its rays meet the surface at
        different distances.

        Args:
            signal_e: expected signal.
            background_e: expected sunlight.
            spread_m: standard deviation of the distances of an echo's rays.
        """
        rise_s = _RISE_SIGMAS * np.hypot(self._pulse_s, 2 * spread_m / SPEED_OF_LIGHT_M_S)
        noise_e = np.sqrt(self._variance(signal_e + background_e))
        larger_e = np.maximum(signal_e, noise_e)
        inverse_snr = np.divide(noise_e, larger_e, out=np.zeros_like(larger_e), where=larger_e > 0)
        by_signal_m = SPEED_OF_LIGHT_M_S / 2 * rise_s * inverse_snr
        return np.hypot(by_signal_m, self._options.noise.range_m)

    def measured(
        self,
        signal_e: FloatArray,
        background_e: FloatArray,
        range_m: FloatArray,
        spread_m: FloatArray,
        random: np.random.Generator,
    ) -> Measured:
        """Measure echoes; all arguments are (N,).

        Args:
            signal_e: expected signal, 0 where nothing returns.
            background_e: expected sunlight.
            range_m: distance; NaN where nothing returns.
            spread_m: standard deviation of the distances of an echo's rays.
            random: for the errors of signal and range.
        """
        options = self._options
        found_e = signal_e
        if options.noise.shot:
            mean_e = np.minimum(signal_e + background_e, _MOST_POISSON)
            found_e = random.poisson(mean_e) - background_e
        found_e = found_e + options.noise.receiver_e * random.standard_normal(len(signal_e))
        most_e = options.receiver.saturation_e
        limit_e = math.inf if most_e is None else most_e
        detected = (signal_e > 0) & (found_e >= self.threshold_e(background_e))
        error_m = random.standard_normal(len(signal_e)) * self.sigma_m(signal_e, background_e, spread_m)
        measured_m = range_m + error_m + options.ranging.bias_m
        step_m = options.ranging.resolution_m
        if step_m > 0:
            measured_m = step_m * np.rint(measured_m / step_m)
        return Measured(
            signal_e=np.minimum(found_e, limit_e),
            detected=detected,
            saturated=detected & (found_e >= limit_e),
            range_m=np.where(detected, measured_m, np.nan),
        )

    def _variance(self, light_e: FloatArray) -> FloatArray:
        noise = self._options.noise
        return np.asarray(noise.shot * light_e + noise.receiver_e**2)
