"""The Earth's orientation against Skyfield, which has its own precession, nutation and GMST."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skyfield.api import load
from skyfield.framelib import itrs
from skyfield.sgp4lib import TEME

from posse_core._environment.earth import (
    R_gcrf_from_teme,
    R_itrf_from_gcrf,
    earth_rotation_angle_rad,
)
from posse_core._environment.time import Epoch

ARCSECOND_RAD = np.radians(1 / 3600)


@pytest.fixture(scope="module", params=["1998-07-02T11:00:00", "2022-01-31T02:02:27.58", "2049-12-31"])
def sky_time(request: pytest.FixtureRequest) -> Any:
    jd1, jd2 = Epoch.from_iso(request.param).tt(np.array(0.0))
    return load.timescale(builtin=True).tt_jd(jd1, jd2)


def turn_between_rad(a: Any, b: Any) -> float:
    """Angle of the rotation from one frame to another, accurate when small."""
    difference = a @ np.asarray(b).T
    return float(np.linalg.norm(difference - np.eye(3)) / np.sqrt(2))


def test_earth_fixed_axes_agree_with_skyfield(sky_time: Any) -> None:
    R = R_itrf_from_gcrf(sky_time.whole, sky_time.tt_fraction, sky_time.whole, sky_time.ut1_fraction)
    # Skyfield's Earth turns by GMST and the equinox of IAU 2000A.
    assert turn_between_rad(R, itrs.rotation_at(sky_time)) < 2e-3 * ARCSECOND_RAD


def test_teme_agrees_with_skyfield(sky_time: Any) -> None:
    R = R_gcrf_from_teme(np.array(sky_time.whole), np.array(sky_time.tt_fraction))
    # Skyfield holds to GMST 1982 too, less its drift against IAU 2006.
    assert turn_between_rad(R.T, TEME.rotation_at(sky_time)) < 0.1 * ARCSECOND_RAD


def test_teme_is_a_third_of_a_degree_from_gcrf() -> None:
    R = R_gcrf_from_teme(*Epoch.from_iso("2022-01-31T02:02:27.58").tt(np.array(0.0)))
    # General precession, 50.29″ a year since J2000.
    assert np.degrees(turn_between_rad(R, np.eye(3))) == pytest.approx(50.29 * 22.08 / 3600, rel=0.01)


def test_rotation_angle_is_the_published_line() -> None:
    # IERS Conventions (2010), equation 5.15, in UT1 days since J2000.
    days = np.array([0.0, 0.25, 8000.0, -3652.75])
    expected = 2 * np.pi * np.mod(0.7790572732640 + 1.00273781191135448 * days, 1.0)
    np.testing.assert_allclose(
        earth_rotation_angle_rad(np.full(4, 2451545.0), days), expected, atol=1e-9
    )


def test_matrices_are_rotations_for_whole_arrays() -> None:
    epoch, t_s = Epoch.from_iso("2022-01-31"), np.linspace(0, 86400, 6).reshape(2, 3)
    for R in (R_gcrf_from_teme(*epoch.tt(t_s)), R_itrf_from_gcrf(*epoch.tt(t_s), *epoch.ut1(t_s))):
        assert R.shape == (2, 3, 3, 3)
        np.testing.assert_allclose(
            R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14
        )
        np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)
