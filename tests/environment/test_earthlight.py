from __future__ import annotations

import numpy as np
import pytest

from posse_core._arrays import FloatArray
from posse_core._environment import earthlight
from posse_core._environment.earthlight import EarthLight, earthlight_on_plate

RADIUS_M = 6378137.0
SUN_M = np.array([1.496e11, 0.0, 0.0])


def light(
    r_m: FloatArray, normal: FloatArray, pole: FloatArray | None = None, jd: float = 2459600.5
) -> EarthLight:
    frames = len(r_m)
    return earthlight_on_plate(
        r_eci_m=r_m,
        normal_eci=normal,
        r_sun_eci_m=np.tile(SUN_M, (frames, 1)),
        earth_pole_eci=np.tile([0.0, 0.0, 1.0] if pole is None else pole, (frames, 1)),
        jd_tt=np.full(frames, jd),
        solar_flux_w_m2=np.full(frames, 1361.0),
        earth_radius_m=RADIUS_M,
    )


@pytest.fixture
def grey_earth(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same reflectance and emissivity everywhere, which has closed forms."""
    monkeypatch.setattr(
        earthlight, "albedo", lambda sin_latitude, jd: np.full(np.shape(sin_latitude), 0.3)
    )
    monkeypatch.setattr(
        earthlight, "emissivity", lambda sin_latitude, jd: np.full(np.shape(sin_latitude), 0.7)
    )


@pytest.mark.usefixtures("grey_earth")
@pytest.mark.parametrize("height_m", [300e3, 705e3, 20200e3, 1e9])
def test_infrared_of_an_even_sphere_is_its_view_factor(height_m: float) -> None:
    # A plate facing a Lambertian sphere has the view factor (R/r)²; tilted by γ without losing sight
    # of any of it, (R/r)² cos γ (Howell, Catalog of Radiation Configuration Factors, B-43).
    distance = RADIUS_M + height_m
    tilts = np.array([0.0, 0.5, 1.0]) * (np.pi / 2 - np.arcsin(RADIUS_M / distance))
    r_m = np.tile([0.0, distance, 0.0], (3, 1))
    normal = np.stack([np.sin(tilts), -np.cos(tilts), 0 * tilts], axis=-1)
    exitance = 0.7 * 1361 / 4
    expected = exitance * (RADIUS_M / distance) ** 2 * np.cos(tilts)
    np.testing.assert_allclose(light(r_m, normal).infrared_w_m2, expected, rtol=1e-3)


@pytest.mark.usefixtures("grey_earth")
def test_albedo_from_afar_is_the_phase_function_of_a_lambert_sphere() -> None:
    # Lambert's sphere: (2/3) A E (R/r)² (sin α + (π − α) cos α)/π (Lester et al. 1979, ApJ 228).
    phase = np.linspace(0, 3.0, 13)
    distance = 2000 * RADIUS_M
    r_m = distance * np.stack([np.cos(phase), np.sin(phase), 0 * phase], axis=-1)
    shape = (np.sin(phase) + (np.pi - phase) * np.cos(phase)) / np.pi
    expected = 2 / 3 * 0.3 * 1361 * (RADIUS_M / distance) ** 2 * shape
    np.testing.assert_allclose(light(r_m, -r_m).albedo_w_m2, expected, atol=3e-3 * expected.max())


@pytest.mark.usefixtures("grey_earth")
def test_albedo_close_above_noon_is_the_grounds() -> None:
    # 100 m up, all that counts is a plane under an overhead Sun: A · E.
    r_m = np.array([[RADIUS_M + 100.0, 0.0, 0.0]])
    assert light(r_m, -r_m).albedo_w_m2[0] == pytest.approx(0.3 * 1361, rel=2e-3)


def test_the_night_side_reflects_nothing_and_radiates() -> None:
    r_m = np.array([[-(RADIUS_M + 705e3), 0.0, 0.0]])
    night = light(r_m, -r_m)
    assert night.albedo_w_m2[0] == 0
    assert 100 < night.infrared_w_m2[0] < 250


def test_a_plate_turned_away_gets_nothing() -> None:
    r_m = np.array([[0.0, RADIUS_M + 705e3, 0.0]])
    away = light(r_m, r_m)
    assert away.albedo_w_m2[0] == 0
    assert away.infrared_w_m2[0] == 0


def test_the_earth_balances_its_heat() -> None:
    """Over the sphere and the year, what is absorbed is sent out, within the model's roundings."""
    sine, weight = np.polynomial.legendre.leggauss(16)
    days = 2459580.5 + np.arange(0, 365.25, 5)
    # By latitude and day, the mean flux over the circle of latitude under the Sun's declination.
    declination = np.radians(-23.44) * np.cos(2 * np.pi * (days - 2459570.5) / 365.25)
    cosine = np.sqrt(1 - sine**2)
    hours = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    height = sine[:, None, None] * np.sin(declination)[:, None] + cosine[:, None, None] * np.cos(
        declination
    )[:, None] * np.cos(hours)
    insolation = np.maximum(height, 0).mean(axis=-1)
    reflected = np.sum(weight[:, None] / 2 * earthlight.albedo(sine[:, None], days) * insolation)
    emitted = np.sum(weight[:, None] / 2 * earthlight.emissivity(sine[:, None], days) / 4)
    total = len(days) / 4
    # Satellites measure a planetary albedo of 0.29 to 0.31 (Wild et al. 2013); the model's is of 1988.
    assert reflected / total == pytest.approx(0.30, abs=0.03)
    assert (reflected + emitted) / total == pytest.approx(1.0, abs=0.03)


def test_seasons_turn_the_sign_of_the_north() -> None:
    r_m = np.array([[RADIUS_M * 0.5, 0.0, RADIUS_M * 1.2]])
    december, june = (light(r_m, -r_m, jd=jd) for jd in (2459570.5, 2459753.0))
    # Snow and a low Sun: the north reflects more and radiates less in December.
    assert december.albedo_w_m2[0] > june.albedo_w_m2[0] * 1.1
    assert december.infrared_w_m2[0] < june.infrared_w_m2[0]


def test_many_frames_are_the_same_one_by_one() -> None:
    angle = np.linspace(0, 6, 700)
    r_m = 7.1e6 * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=-1)
    together = light(r_m, -r_m)
    for k in (0, 511, 512, 699):
        np.testing.assert_array_equal(
            light(r_m[k : k + 1], -r_m[k : k + 1]).albedo_w_m2, together.albedo_w_m2[k]
        )
