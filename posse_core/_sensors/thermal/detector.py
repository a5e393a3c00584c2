"""From radiance in the detector's band to digital numbers."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._randomness import random_generator
from posse_core._sensors.thermal.options import ThermalOptions

REFERENCE_K = 300.0
"""Temperature at which noise is given."""


class Detector:
    """A bolometer array whose digital numbers are linear in the radiance.

    Its noise is its own and not that of photons, so it is the same for a cold and a hot scene, and as
    radiance it grows with the f-number N as 4 N² + 1: the irradiance of a pixel is π L / (4 N² + 1)
    (Vollmer & Möllmann, Infrared Thermal Imaging, 2nd ed. 2018, section 2.4).
    """

    def __init__(self, options: ThermalOptions, shape: tuple[int, int], seed: int, name: str) -> None:
        """seed and name: of the run, and of the sensor in it; they determine the pixels' offsets."""
        band = options.band
        dimmer = (4 * options.f_number**2 + 1) / (4 * options.netd_f_number**2 + 1)
        slope = dimmer * band.slope_w_m2_sr_k(REFERENCE_K)
        self.noise_w_m2_sr = options.netd_k * slope
        self.largest_dn = 2**options.bit_depth - 1
        low, high = band.radiance_w_m2_sr(np.array(options.range_k))
        self.offset_w_m2_sr = float(low)
        self.gain_w_m2_sr_dn = float((high - low) / self.largest_dn)
        self.pattern_sigma_w_m2_sr = options.fixed_pattern_k * slope
        random = random_generator(seed, -1, f"sensor {name}: fixed pattern")
        self._pattern_w_m2_sr: FloatArray = self.pattern_sigma_w_m2_sr * random.standard_normal(shape)

    def image(self, radiance_w_m2_sr: Float32Array, random: np.random.Generator) -> AnyArray:
        """(H, W) radiance → (H, W) digital numbers, uint8 or uint16."""
        noise = self.noise_w_m2_sr * random.standard_normal(radiance_w_m2_sr.shape)
        measured = radiance_w_m2_sr + self._pattern_w_m2_sr + noise
        dn = np.rint((measured - self.offset_w_m2_sr) / self.gain_w_m2_sr_dn)
        kind = np.uint8 if self.largest_dn < 256 else np.uint16
        return np.clip(dn, 0, self.largest_dn).astype(kind)
