"""Time scales: an epoch in UTC, and TT, TDB and UT1 at given seconds after it.

Seconds after an epoch are SI seconds on the Earth, so a leap second in between counts as one.
UT1 is approximated by UTC, which is accurate to 0.9 s (13.5″ of the Earth's rotation). Leap seconds
after the last one that the installed ERFA knows are assumed not to occur.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import erfa
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError

SECONDS_PER_DAY = 86400.0
_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d(?:\.\d*)?))?)?Z?")
_FIRST_UTC_YEAR = 1960

JulianDates = tuple[FloatArray, FloatArray]
"""Julian dates as the sum of two parts, which both have the shape of the given seconds."""

# The functions of erfa.ufunc return ERFA's status in place of a warning. 1 is "dubious year", which here
# can only mean a year whose leap seconds are not known yet; negative numbers mean an impossible date.


@dataclass(frozen=True)
class Epoch:
    """An instant in UTC.

    Attributes:
        jd1_utc, jd2_utc: ERFA's two-part quasi-Julian date: a day with a leap second has 86 401 s.
    """

    jd1_utc: float
    jd2_utc: float

    @classmethod
    def from_iso(cls, text: str) -> Epoch:
        """Read ISO 8601 in UTC: ``2022-01-31T02:02:27.58``; the time of day or its seconds are optional.

        Raises:
            InputError: The text is not of this form, is no date, or is before 1960, when UTC began.
        """
        match = _ISO.fullmatch(text.strip())
        if match is None:
            raise InputError(
                f"epoch {text!r} is not ISO 8601 in UTC; write it as 2022-01-31T02:02:27.58"
            )
        year, month, day, hour, minute = (int(part or 0) for part in match.groups()[:5])
        if year < _FIRST_UTC_YEAR:
            raise InputError(f"epoch {text!r} is before {_FIRST_UTC_YEAR}, when UTC began")
        second = float(match[6] or 0.0)
        jd1, jd2, status = erfa.ufunc.dtf2d(b"UTC", year, month, day, hour, minute, second)
        if status not in (0, 1):
            raise InputError(f"epoch {text!r} does not exist; check month, day, hour, minute, second")
        return cls(float(jd1), float(jd2))

    def iso(self) -> str:
        """Return ISO 8601 in UTC, to the nanosecond without trailing zeros, such as 02:02:27.58."""
        year, month, day, clock, _ = erfa.ufunc.d2dtf(b"UTC", 9, self.jd1_utc, self.jd2_utc)
        hour, minute, second, nanosecond = clock.item()
        fraction = f".{nanosecond:09d}".rstrip("0").rstrip(".")
        return f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:02d}{fraction}"

    def shifted(self, t_s: float) -> Epoch:
        """Return the epoch ``t_s`` seconds later."""
        jd1, jd2, _ = erfa.ufunc.taiutc(*self._tai(np.float64(t_s)))
        return Epoch(float(jd1), float(jd2))

    def seconds_until(self, later: Epoch) -> float:
        """Return the SI seconds from this epoch to another, negative where that is earlier."""
        (a1, a2), (b1, b2) = (epoch._tai(np.float64(0.0)) for epoch in (self, later))
        return float(((b1 - a1) + (b2 - a2)) * SECONDS_PER_DAY)

    def tt(self, t_s: FloatArray) -> JulianDates:
        """Return the terrestrial time (TT) ``t_s`` seconds later; any shape."""
        jd1, jd2, _ = erfa.ufunc.taitt(*self._tai(t_s))
        return jd1, jd2

    def tdb(self, t_s: FloatArray) -> JulianDates:
        """Return the barycentric dynamical time (TDB) ``t_s`` seconds later at the geocentre; any shape.

        Source: Fairhead & Bretagnon (1990), by ERFA's ``dtdb``.
        """
        jd1, jd2 = self.tt(t_s)
        tdb_minus_tt_s = erfa.dtdb(jd1, jd2, 0.0, 0.0, 0.0, 0.0)
        return jd1, jd2 + tdb_minus_tt_s / SECONDS_PER_DAY

    def ut1(self, t_s: FloatArray) -> JulianDates:
        """Return UT1, approximated by UTC, ``t_s`` seconds later; any shape."""
        utc1, utc2, _ = erfa.ufunc.taiutc(*self._tai(t_s))
        jd1, jd2, _ = erfa.ufunc.utcut1(utc1, utc2, 0.0)
        return jd1, jd2

    def _tai(self, t_s: FloatArray | np.float64) -> JulianDates:
        jd1, jd2, _ = erfa.ufunc.utctai(self.jd1_utc, self.jd2_utc)
        later = jd2 + np.asarray(t_s, dtype=np.float64) / SECONDS_PER_DAY
        return np.broadcast_to(jd1, later.shape), later
