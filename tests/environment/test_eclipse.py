from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from posse_core._arrays import FloatArray
from posse_core._constants import WGS84_FLATTENING, Constants
from posse_core._environment.eclipse import (
    disc_fraction_in_view,
    solar_flux_w_m2,
    sun_angular_radius_rad,
    sun_fraction,
)
from posse_core._errors import InputError

C = Constants()
SUN_M = np.array([1.48e11, 0.0, 0.0])
SUN_RAD = 0.004652
RADII_RAD = (1.56, 1.122, 0.15, 0.02, 0.0047, SUN_RAD, 0.003)


def fraction(r_m: FloatArray, sun_m: FloatArray = SUN_M, **ellipsoid: object) -> FloatArray:
    return sun_fraction(
        r_m, sun_m, earth_radius_m=C.earth_radius_m, sun_radius_m=C.sun_radius_m, **ellipsoid
    )


def precise_disc_fraction(a: float, b: float, c: float) -> float:
    """The textbook's formula (Montenbruck & Gill 3.87–3.94) with fifty digits."""
    with mpmath.workdps(50):
        a, b, c = mpmath.mpf(a), mpmath.mpf(b), mpmath.mpf(c)
        if c >= a + b:
            return 1.0
        if c <= abs(a - b):
            return float(max(0, 1 - (b / a) ** 2))
        x = (c**2 + a**2 - b**2) / (2 * c)
        y = mpmath.sqrt(a**2 - x**2)
        lens = a**2 * mpmath.acos(x / a) + b**2 * mpmath.acos((c - x) / b) - c * y
        return float(1 - lens / (mpmath.pi * a**2))


@pytest.mark.parametrize("earth_rad", RADII_RAD)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_disc_fraction_near_and_between_contacts(earth_rad: float, side: float) -> None:
    # From 1e-15 of a radius off the contact to the middle.
    steps = np.concatenate([side * (1 - 10.0 ** np.arange(-15, 0)), np.linspace(-1, 1, 9)])
    distances = earth_rad + steps * SUN_RAD
    distances = distances[distances > 0]
    ours = disc_fraction_in_view(np.array(SUN_RAD), np.array(earth_rad), distances)
    expected = [precise_disc_fraction(SUN_RAD, earth_rad, d) for d in distances]
    np.testing.assert_allclose(ours, expected, atol=1e-12)


def test_disc_fraction_is_the_area_by_quadrature() -> None:
    a, b, c = 0.3, 0.8, 0.75

    def hidden_width(x: float) -> float:
        """Of the strip of the Sun's disc at x towards the Earth's centre."""
        sun = np.sqrt(max(a * a - x * x, 0.0))
        return 2 * min(sun, np.sqrt(max(b * b - (c - x) ** 2, 0.0)))

    hidden, _ = integrate.quad(hidden_width, c - b, a, limit=400, epsabs=1e-12)
    shown = disc_fraction_in_view(np.array(a), np.array(b), np.array(c))
    assert shown == pytest.approx(1 - hidden / (np.pi * a * a), abs=1e-9)


def test_disc_fraction_whole_none_and_annular() -> None:
    a, b, c = (
        np.array([1.0, 1.0, 1.0, 2.0]),
        np.array([2.0, 2.0, 2.0, 1.0]),
        np.array([3.5, 0.5, 3.0, 0.3]),
    )
    np.testing.assert_array_equal(disc_fraction_in_view(a, b, c), [1.0, 0.0, 1.0, 0.75])


def rays_that_miss(r_m: FloatArray, sun_m: FloatArray, flattening: float = 0.0) -> float:
    """Share of the Sun's true disc whose straight rays miss the Earth, by quadrature on a grid."""
    to_sun = sun_m - r_m
    axis = to_sun / np.linalg.norm(to_sun)
    # u along the line from the Earth's centre, so that the rim is nearly a line of constant u.
    u = axis * (r_m @ axis) - r_m
    u /= np.linalg.norm(u)
    w = np.cross(axis, u)
    n = 2000
    grid = (np.arange(n) + 0.5) / n * 2 - 1
    fine, coarse = np.meshgrid(grid, grid[:: n // 200], indexing="ij")
    on_disc = fine**2 + coarse**2 < 1
    sine = np.sin(float(sun_angular_radius_rad(r_m, sun_m, C.sun_radius_m)))
    rays = axis + sine * (fine[on_disc][:, None] * u + coarse[on_disc][:, None] * w)
    scale = np.array([1.0, 1.0, 1 / (1 - flattening)]) / C.earth_radius_m
    start, rays = r_m * scale, rays * scale
    along = rays @ start
    hit = (along < 0) & (along**2 > (rays**2).sum(axis=-1) * (start @ start - 1))
    return float(1 - hit.mean())


def place_behind(height_m: float, latitude_rad: float, step: float, flattening: float) -> FloatArray:
    """A place behind the Earth, ``step`` solar radii from the limb, in the plane of a latitude."""
    side = np.array([0.0, np.cos(latitude_rad), np.sin(latitude_rad)])
    radius = C.earth_radius_m * (1 - flattening * np.sin(latitude_rad) ** 2)
    distance = C.earth_radius_m + height_m
    angle = np.arcsin(radius / distance) + step * SUN_RAD
    return distance * (np.sin(angle) * side - np.cos(angle) * np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize("height_m", [705e3, 20200e3, 35786e3])
@pytest.mark.parametrize("step", [-0.6, 0.0, 0.7])
def test_plane_discs_stand_for_rays_to_the_true_sphere(height_m: float, step: float) -> None:
    # A cap of 64° has a straighter rim than a plane disc of that radius: the model's own error.
    limit = 2.5e-4 if height_m < 1e6 else 1e-4
    r_m = place_behind(height_m, 0.0, step, 0.0)
    assert fraction(r_m) == pytest.approx(rays_that_miss(r_m, SUN_M), abs=limit)


@pytest.mark.parametrize("latitude_deg", [0, 35, 60, 90])
@pytest.mark.parametrize("height_m", [705e3, 35786e3])
def test_ellipsoid_against_rays(latitude_deg: float, height_m: float) -> None:
    r_m = place_behind(height_m, np.radians(latitude_deg), 0.2, WGS84_FLATTENING)
    ours = fraction(r_m, flattening=WGS84_FLATTENING, earth_pole_eci=np.array([0.0, 0.0, 1.0]))
    assert ours == pytest.approx(rays_that_miss(r_m, SUN_M, WGS84_FLATTENING), abs=1e-3)
    assert 0.2 < ours < 0.9


def test_ellipsoid_matters_over_the_pole() -> None:
    r_m = place_behind(705e3, np.pi / 2, 0.0, 0.0)
    flattened = fraction(r_m, flattening=WGS84_FLATTENING, earth_pole_eci=np.array([0.0, 0.0, 1.0]))
    assert fraction(r_m) == pytest.approx(0.5, abs=0.01)
    assert flattened > 0.99  # 21 km lower limb, in a penumbra 28 km wide


def test_ellipsoid_right_behind_the_centre_is_dark() -> None:
    r_m = np.array([[-7e6, 0.0, 0.0], [7e6, 0.0, 0.0]])
    ours = fraction(r_m, flattening=WGS84_FLATTENING, earth_pole_eci=np.array([0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(ours, [0.0, 1.0])


def test_aquas_penumbra_lasts_as_published() -> None:
    # In a circular orbit of 7 080.6 km through the shadow's axis the penumbra's length follows from the
    # Sun's diameter alone: 2 asin(R☉/d) of arc, at n.
    n = np.sqrt(C.mu_earth_m3_s2 / 7080.6e3**3)
    t_s = np.linspace(0, 2 * np.pi / n, 400_001)
    r_m = 7080.6e3 * np.stack([np.cos(n * t_s), np.sin(n * t_s), 0 * t_s], axis=-1)
    shown = fraction(r_m)
    in_penumbra_s = np.mean((shown > 0) & (shown < 1)) * t_s[-1] / 2
    sun_diameter_rad = 2 * float(sun_angular_radius_rad(np.zeros(3), SUN_M, C.sun_radius_m))
    assert in_penumbra_s == pytest.approx(sun_diameter_rad / n, rel=0.01)


places = st.tuples(
    st.floats(6.4e6, 5e7), st.floats(0, np.pi), st.floats(0, 2 * np.pi), st.floats(1.45e11, 1.53e11)
)


@given(place=places)
def test_fraction_is_between_0_and_1_and_1_on_the_day_side(
    place: tuple[float, float, float, float],
) -> None:
    distance, angle, azimuth, sun_distance = place
    direction = np.array(
        [np.cos(angle), np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth)]
    )
    ours = fraction(distance * direction, np.array([sun_distance, 0.0, 0.0]))
    assert 0 <= ours <= 1
    if angle < np.pi / 2 - 0.01:
        assert ours == 1


@given(distance=st.floats(6.5e6, 5e7), start=st.floats(-1.3, 1.3))
def test_fraction_grows_with_the_angle_between_sun_and_earth_without_jumps(
    distance: float, start: float
) -> None:
    limb = np.arcsin(C.earth_radius_m / distance)
    angles = limb + (start + np.linspace(0, 1e-3, 30)) * SUN_RAD
    r_m = distance * np.stack([-np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    steps = np.diff(fraction(r_m))
    assert np.all(steps >= -1e-13)
    # No disc can be uncovered faster than along its whole diameter, 2/π of its area a radius.
    assert np.all(steps <= 2 / np.pi * 1e-3 / 29 * 1.05)


def test_a_place_inside_the_earth_is_refused() -> None:
    for ellipsoid in ({}, {"flattening": 0.003, "earth_pole_eci": np.array([0.0, 0.0, 1.0])}):
        with pytest.raises(InputError, match="below the Earth's surface"):
            fraction(np.array([[7e6, 0.0, 0.0], [6.3e6, 0.0, 0.0]]), **ellipsoid)


def test_flux_falls_with_the_square() -> None:
    # 1361 W/m² at 1 au; the Earth's perihelion and aphelion of 2022 (0.983337, 1.016715 au).
    au = np.array([1.0, 0.983337, 1.016715])
    sun_m = np.stack([au * C.au_m, 0 * au, 0 * au], axis=-1)
    flux = solar_flux_w_m2(np.zeros(3), sun_m, solar_constant_w_m2=1361.0, au_m=C.au_m)
    np.testing.assert_allclose(flux, [1361.0, 1407.516, 1316.617], rtol=1e-6)
