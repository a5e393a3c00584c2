"""The atmosphere against closed forms and an integration by another method."""

import numpy as np
import pytest
from scipy.integrate import quad

from posse_core._sky.air import GROUND_ROWS, LIMB_ROWS, air_tables
from posse_core._sky.atmosphere import (
    AEROSOL_DEPTH,
    EXTINCTION,
    GROUND_MU_MIN,
    GROUND_SUNS,
    OZONE_DEPTH,
    RADIUS_M,
    RAYLEIGH_DEPTH,
    TOP_M,
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


@pytest.mark.parametrize("sun_zenith_cosine", [0.7, 0.1, -0.1, -0.3])
@pytest.mark.parametrize("altitude_m", [300e3, 700e3, 36e6])
def test_the_light_of_the_air_is_the_sum_along_each_ray(
    altitude_m: float, sun_zenith_cosine: float
) -> None:
    """Of 4000 short steps in Cartesian coordinates, of air and haze in sunlight, dimmed on the way."""
    camera_m = np.array([0.0, 0.0, RADIUS_M + altitude_m])
    sun = np.array([np.sqrt(1 - sun_zenith_cosine**2), 0.0, sun_zenith_cosine])
    light = air_tables(camera_m[2], sun_zenith_cosine).light[..., :3].astype(float)
    columns = light.shape[1]
    for row in (5, 30, 60, GROUND_ROWS + 1, GROUND_ROWS + 15, GROUND_ROWS + 40):
        for column in (0, columns // 3, columns // 2, columns - 1):
            if row < GROUND_ROWS:
                nearest_m = RADIUS_M * np.sqrt(1 - (row / (GROUND_ROWS - 1)) ** 2)
            else:
                nearest_m = RADIUS_M + TOP_M * ((row - GROUND_ROWS) / (LIMB_ROWS - 1)) ** 2
            sine, azimuth = nearest_m / camera_m[2], np.pi * column / (columns - 1)
            ray = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), -np.sqrt(1 - sine**2)])
            ahead_m = -camera_m @ ray
            half_m = np.sqrt((RADIUS_M + TOP_M) ** 2 - nearest_m**2)
            below_m = np.sqrt(max(0.0, RADIUS_M**2 - nearest_m**2))
            last_m = -below_m if row < GROUND_ROWS else half_m
            borders_m = ahead_m + np.linspace(-half_m, last_m, 4001)
            step_m = borders_m[1] - borders_m[0]
            points_m = camera_m + (borders_m[:-1, None] + step_m / 2) * ray
            radius_m = np.linalg.norm(points_m, axis=1)
            density = densities(np.maximum(0, radius_m - RADIUS_M)) * step_m
            depth = density @ EXTINCTION
            reaches = np.exp(-(np.cumsum(depth, axis=0) - depth / 2))
            reaches *= sunlight(radius_m - RADIUS_M, (points_m @ sun) / radius_m)
            cosine = float(ray @ sun)
            of_air = 3 / (16 * np.pi) * (1 + cosine**2) * RAYLEIGH_DEPTH
            of_haze = 0.95 * AEROSOL_DEPTH * (1 - 0.49) / (4 * np.pi * (1.49 - 1.4 * cosine) ** 1.5)
            scattered = density[:, :1] * of_air + density[:, 1:2] * of_haze
            expected = (reaches * scattered).sum(axis=0)
            assert light[row, column] == pytest.approx(expected, rel=0.02, abs=4e-4), (row, column)
