"""The Sun's light by band, against the standard spectrum."""

import numpy as np
import pvlib
import pytest

from posse_core._model.bands import BAND_EDGES_M, SOLAR_BAND_FRACTIONS

ASTM_TOTAL_W_M2 = 1366.1
"""Solar constant of the spectrum; the table leaves out what is beyond 280 and 4000 nm, 1.3 % of it."""


def test_sunlight_by_band_is_that_of_the_measured_spectrum() -> None:
    """ASTM G173-03, extraterrestrial, as pvlib has it, scaled to 1361 W/m²."""
    spectrum = pvlib.spectrum.get_reference_spectra(standard="ASTM G173-03")["extraterrestrial"]
    wavelength_nm, irradiance = spectrum.index.to_numpy(float), spectrum.to_numpy()
    assert np.trapezoid(irradiance, wavelength_nm) == pytest.approx(ASTM_TOTAL_W_M2, rel=0.015)
    for (low_m, high_m), share in zip(BAND_EDGES_M, SOLAR_BAND_FRACTIONS, strict=True):
        inside = (wavelength_nm >= 1e9 * low_m - 0.1) & (wavelength_nm <= 1e9 * high_m + 0.1)
        expected_w_m2 = np.trapezoid(irradiance[inside], wavelength_nm[inside])
        assert share * ASTM_TOTAL_W_M2 == pytest.approx(expected_w_m2, rel=1e-4)
    assert pytest.approx([158.2, 184.0, 185.8], abs=0.05) == 1361.0 * SOLAR_BAND_FRACTIONS
