from __future__ import annotations

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._environment.ephemeris import earth_velocity_m_s, moon_eci_m, sun_eci_m
from posse_core._errors import InputError

AU_M = 149_597_870_700.0
DAYS = np.linspace(-36000.0, 18000.0, 400)
J2000 = np.full(DAYS.shape, 2451545.0)


def test_sun_is_within_20_km_of_vsop() -> None:
    # ERFA's epv00 is fitted to VSOP2000 and DE405 (Moisson & Bretagnon 2001): no JPL file of ours.
    # It is made for 1900 to 2100.
    heliocentric, _ = erfa.epv00(J2000, DAYS)
    difference_m = np.linalg.norm(sun_eci_m(J2000, DAYS) + heliocentric["p"] * AU_M, axis=-1)
    assert difference_m.max() < 20e3


def test_moon_is_within_the_stated_error_of_elp() -> None:
    # ERFA's moon98 (Meeus 1998, after ELP 2000-82B) errs by up to 10″ in longitude: 20 km and more.
    meeus_m = erfa.moon98(J2000, DAYS)["p"] * AU_M
    assert np.linalg.norm(moon_eci_m(J2000, DAYS) - meeus_m, axis=-1).max() < 40e3


@pytest.mark.parametrize("days", [-30000.0, -0.25, 8065.08, 18000.0])
def test_the_earths_velocity_is_that_of_vsop(days: float) -> None:
    _, barycentric = erfa.epv00(2451545.0, days)
    expected_m_s = barycentric["v"] * AU_M / 86400
    assert np.linalg.norm(earth_velocity_m_s(2451545.0 + days) - expected_m_s) < 5e-3


@given(days=st.lists(st.floats(-36000, 70000), min_size=1, max_size=5))
def test_a_time_alone_gives_what_it_gives_among_others(days: list[float]) -> None:
    together = sun_eci_m(np.full(len(days), 2451545.0), np.array(days))
    for k, day in enumerate(days):
        np.testing.assert_array_equal(sun_eci_m(np.array(2451545.0), np.array(day)), together[k])


def test_any_shape() -> None:
    assert moon_eci_m(np.array(2451545.0), np.zeros((2, 3))).shape == (2, 3, 3)


@pytest.mark.parametrize("jd", [2414000.0, 2530000.0, np.nan])
def test_a_time_outside_is_refused(jd: float) -> None:
    with pytest.raises(InputError, match="outside the ephemeris DE421"):
        sun_eci_m(np.array([2451545.0, jd]), np.zeros(2))
    with pytest.raises(InputError, match="outside the ephemeris DE421"):
        earth_velocity_m_s(jd)
