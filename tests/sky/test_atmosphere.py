"""The atmosphere against closed forms and an integration by another method."""

import numpy as np
import pytest
from scipy.integrate import quad

from posse_core._sky.atmosphere import (
    AEROSOL_DEPTH,
    EXTINCTION,
    GROUND_MU_MIN,
    GROUND_ROWS,
    GROUND_SUNS,
    LIMB_ROWS,
    OZONE_DEPTH,
    RADIUS_M,
    RAYLEIGH_DEPTH,
    TOP_M,
    air_tables,
    densities,
    ground_irradiance,
    sunlight,
)


def _slant_depth(height_m: float, mu: float) -> np.ndarray:
    """(3,) optical depth from a height to space, at a cosine of the zenith angle, by adaptive
    quadrature."""
    r = RADIUS_M + height_m
    end = -r * mu + np.sqrt((RADIUS_M + TOP_M) ** 2 - r**2 * (1 - mu**2))

    def density(s: float, species: int) -> float:
        return densities(np.array(np.sqrt(r**2 + s**2 + 2 * r * mu * s) - RADIUS_M))[species]

    column = [
        quad(density, 0, end, args=(k,), limit=400, points=np.geomspace(1e3, end / 2, 8))[0]
        for k in range(3)
    ]
    return np.array(column) @ EXTINCTION


def test_optical_depths_agree_with_the_literature() -> None:
    """Rayleigh scattering at sea level at 650, 550 and 450 nm (Bodhaine et al. 1999); also, the
    densities integrate to 1."""
    assert pytest.approx([0.0491, 0.0971, 0.2214], rel=0.02) == RAYLEIGH_DEPTH
    assert _slant_depth(0.0, 1.0) == pytest.approx(
        RAYLEIGH_DEPTH + AEROSOL_DEPTH + OZONE_DEPTH, rel=1e-3
    )


@pytest.mark.parametrize("height_m", [0.0, 3000.0, 12e3, 30e3])
@pytest.mark.parametrize("mu", [1.0, 0.5, 0.2, 0.08, 0.02])
def test_sunlight_agrees_with_the_integral_of_the_density(height_m: float, mu: float) -> None:
    got = sunlight(np.array([[height_m]]), np.array([[mu]]))[0, 0]
    assert got == pytest.approx(np.exp(-_slant_depth(height_m, mu)), abs=0.008)


def test_the_earth_shadows_the_air_behind_it() -> None:
    """The geometric shadow at height h begins at cos z = −√(1 − (R/(R+h))²)."""
    edge = -np.sqrt(1 - (RADIUS_M / (RADIUS_M + 40e3)) ** 2)
    below, above = sunlight(np.full((1, 2), 40e3), np.array([[edge - 1e-3, edge + 1e-3]]))[0]
    assert (below == 0).all()
    assert above[0] > 0


def test_ground_irradiance_falls_and_reddens_with_the_sun_and_leaves_a_blue_twilight() -> None:
    mu = np.linspace(GROUND_MU_MIN, 1, GROUND_SUNS)
    light = ground_irradiance()[0, :, :3].astype(float)
    assert (np.diff(light[mu > -0.1], axis=0) >= -1e-6).all()
    noon, evening, twilight = (light[np.argmin(abs(mu - m))] for m in (1.0, 0.08, -0.06))
    assert (noon < 1).all()
    assert (noon > 0.8).all()
    assert evening[2] / evening[0] < 1.1
    assert twilight[2] > 1.5 * twilight[0] > 0
    assert (light[mu < -0.25] < 1e-6).all()


def test_rays_from_space_are_attenuated_by_their_path_through_the_air() -> None:
    tables = air_tables(7.08e6, 0.5)
    for row in (4, 20, 40):
        passing_m = TOP_M * (row / (LIMB_ROWS - 1)) ** 2
        expected = np.exp(-2 * _slant_depth(passing_m, 0.0))
        assert tables.passed[GROUND_ROWS + row, 0, :3] == pytest.approx(expected, abs=0.02)


def test_the_glow_of_thin_air_is_single_scattering() -> None:
    """At 60 km only air scatters and attenuation is negligible: L/E = τ P(Θ), with τ = 2 τ_z K for the
    whole slant path."""
    tables = air_tables(7.08e6, 0.0)
    row = round((LIMB_ROWS - 1) * np.sqrt(60e3 / TOP_M))
    passing_m = TOP_M * (row / (LIMB_ROWS - 1)) ** 2
    depth = (
        2
        * quad(
            lambda s: np.exp(-(np.hypot(RADIUS_M + passing_m, s) - RADIUS_M) / 8000) / 8000,
            0,
            8e5,
            limit=200,
        )[0]
    )
    sine = (RADIUS_M + passing_m) / 7.08e6
    for column, cosine in ((0, sine), (-1, -sine)):  # the Sun on the camera's horizon
        if cosine < 0:
            continue  # away from the Sun the limb is in shadow
        phase = 3 / (16 * np.pi) * (1 + cosine**2)
        assert tables.light[GROUND_ROWS + row, column, :3] == pytest.approx(
            RAYLEIGH_DEPTH * depth * phase, rel=0.03
        )
    assert tables.light[GROUND_ROWS + row, 0, 2] > 3 * tables.light[GROUND_ROWS + row, 0, 0]
