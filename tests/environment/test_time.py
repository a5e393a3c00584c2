from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._environment.time import Epoch
from posse_core._errors import InputError


@pytest.mark.parametrize(
    "text",
    [
        "2022-01-31T02:02:27.58",
        "2016-12-31T23:59:60.5",
        "1999-12-31T23:59:59.999999999",
        "2049-01-01T00:00:00",
    ],
)
def test_iso_is_read_and_written_alike(text: str) -> None:
    assert Epoch.from_iso(text).iso() == text


@pytest.mark.parametrize(
    ("short", "full"),
    [
        ("2022-01-31", "2022-01-31T00:00:00"),
        ("2022-01-31 02:02", "2022-01-31T02:02:00"),
        ("2022-01-31T02:02:27.580Z", "2022-01-31T02:02:27.58"),
    ],
)
def test_short_forms(short: str, full: str) -> None:
    assert Epoch.from_iso(short).iso() == full


@pytest.mark.parametrize(
    "text",
    [
        "2022-02-30",
        "2022-13-01",
        "2022-01-31T24:01:00",
        "2022-01-31T02:02:60",
        "1959-12-31",
        "31.1.2022",
        "2022-01-31T02:02:27+01:00",
        "",
        "nan",
    ],
)
def test_what_is_no_epoch_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError) as error:
        Epoch.from_iso(text)
    assert repr(text) in str(error.value)
    assert "\n" not in str(error.value)


def test_seconds_count_through_a_leap_second() -> None:
    epoch = Epoch.from_iso("2016-12-31T23:59:59")
    assert [epoch.shifted(t).iso()[-8:] for t in (0.0, 1.0, 2.0)] == ["23:59:59", "23:59:60", "00:00:00"]
    tt = epoch.tt(np.array([0.0, 3.0]))
    assert np.diff(tt[0] + tt[1])[0] * 86400 == pytest.approx(3.0, abs=1e-4)
    ut1 = epoch.ut1(np.array([0.0, 3.0]))
    assert np.diff(ut1[1])[0] * 86400 == pytest.approx(2.0, abs=1e-9)


def test_terrestrial_time_is_tai_and_the_published_constant() -> None:
    # 37 leap seconds since 2017 (IERS Bulletin C 52), TT − TAI = 32.184 s.
    jd1, jd2 = Epoch.from_iso("2022-01-31T00:00:00").tt(np.array(0.0))
    assert ((jd1 - 2459610.5) + jd2) * 86400 == pytest.approx(37 + 32.184, abs=1e-6)


def test_dynamical_time_swings_by_the_published_amplitude() -> None:
    # TDB − TT = 0.001657 s sin g + …, g the Earth's mean anomaly (Explanatory Supplement 2013, 3.50);
    # what is left out is below 50 µs.
    t_s = np.linspace(0, 365.25 * 86400, 200)
    epoch = Epoch.from_iso("2022-01-01")
    tt, tdb = epoch.tt(t_s), epoch.tdb(t_s)
    days = (tt[0] - 2451545.0) + tt[1]
    g = np.radians(357.53 + 0.98560028 * days)
    expected_s = 0.001657 * np.sin(g) + 0.000014 * np.sin(2 * g)
    np.testing.assert_allclose((tdb[1] - tt[1]) * 86400, expected_s, atol=60e-6)


@given(start=st.datetimes(datetime(2017, 1, 2), datetime(2045, 1, 1)), seconds=st.floats(-1e4, 3e6))
def test_shift_is_calendar_arithmetic_where_no_second_leaps(start: datetime, seconds: float) -> None:
    later = Epoch.from_iso(start.isoformat()).shifted(seconds)
    difference = datetime.fromisoformat(later.iso()[:26]) - (start + timedelta(seconds=seconds))
    assert abs(difference.total_seconds()) < 3e-6


@given(t_s=st.floats(0, 1e7))
def test_the_instant_does_not_depend_on_the_way_to_it(t_s: float) -> None:
    epoch = Epoch.from_iso("2022-01-31T02:02:27.58")
    there = epoch.tt(np.array(t_s))
    step = epoch.shifted(t_s).tt(np.array(0.0))
    assert ((there[0] - step[0]) + (there[1] - step[1])) * 86400 == pytest.approx(0, abs=1e-8)
