"""Sun, Moon and the Earth's motion from JPL's ephemeris DE421 (Folkner, Williams & Boggs 2009, IPN PR
42-178).

Positions are geometric: without light time (because of which the Sun appears displaced by 20.5″) and
without aberration. Axes are those of DE421, which agree with the ICRF within 1 mas.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import de421
import numpy as np
from jplephem.ephem import Ephemeris

from posse_core._arrays import FloatArray
from posse_core._errors import InputError

_M_PER_KM = 1000.0
_DAY_S = 86400.0
_OBLIQUITY_RAD = np.radians(84381.406 / 3600)
ECLIPTIC_NORTH_ECI: FloatArray = np.array([0.0, -np.sin(_OBLIQUITY_RAD), np.cos(_OBLIQUITY_RAD)])
"""(3,) unit vector of the north pole of the ecliptic of J2000, GCRF axes (obliquity of IAU 2006)."""
ECLIPTIC_NORTH_ECI.setflags(write=False)


@cache
def _ephemeris() -> Any:
    return Ephemeris(de421)


def sun_eci_m(jd1_tdb: FloatArray, jd2_tdb: FloatArray) -> FloatArray:
    """Geocentric position of the Sun, GCRF axes: two-part Julian dates of any shape → (..., 3) m.

    Raises:
        InputError: A time is outside the ephemeris, 1899-12-04 to 2200-02-01.
    """
    earth_moon = _position_m("earthmoon", jd1_tdb, jd2_tdb)
    earth = earth_moon - moon_eci_m(jd1_tdb, jd2_tdb) * float(_ephemeris().earth_share)
    return _position_m("sun", jd1_tdb, jd2_tdb) - earth


def moon_eci_m(jd1_tdb: FloatArray, jd2_tdb: FloatArray) -> FloatArray:
    """Geocentric position of the Moon, GCRF axes: two-part Julian dates of any shape → (..., 3) m.

    Raises:
        InputError: A time is outside the ephemeris, 1899-12-04 to 2200-02-01.
    """
    return _position_m("moon", jd1_tdb, jd2_tdb)


def earth_velocity_m_s(jd_tdb: float) -> FloatArray:
    """(3,) velocity of the Earth's centre relative to the barycentre of the solar system, GCRF axes.

    Raises:
        InputError: The time is outside the ephemeris, 1899-12-04 to 2200-02-01.
    """
    jd = np.array([jd_tdb])
    _check(jd)
    ephemeris = _ephemeris()
    _, earth_moon = ephemeris.position_and_velocity("earthmoon", jd)
    _, moon = ephemeris.position_and_velocity("moon", jd)
    velocity_km_day = earth_moon - moon * float(ephemeris.earth_share)
    return np.asarray(velocity_km_day[:, 0] * (_M_PER_KM / _DAY_S))


def _position_m(body: str, jd1: FloatArray, jd2: FloatArray) -> FloatArray:
    jd1, jd2 = np.broadcast_arrays(jd1, jd2)
    _check(jd1 + jd2)
    position_km = _ephemeris().position(body, jd1.ravel(), jd2.ravel())
    return np.asarray(position_km.T.reshape(*jd1.shape, 3) * _M_PER_KM)


def _check(jd_tdb: FloatArray) -> None:
    first, last = float(_ephemeris().jalpha), float(_ephemeris().jomega)
    # The negation makes NaN an error too.
    if not np.all((jd_tdb >= first) & (jd_tdb <= last)):
        raise InputError(
            f"a time of the scenario is outside the ephemeris DE421 (1899-12-04 to 2200-02-01,"
            f" Julian dates {first:.1f} to {last:.1f}); choose an epoch and times within it"
        )
