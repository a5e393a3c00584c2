"""From the scenario's orbit to its epoch, period and state."""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics import elements
from posse_core._dynamics.tle import Tle
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._scenario.orbit import OrbitConfig


def orbit_epoch(orbit: OrbitConfig) -> Epoch:
    """The epoch that the orbit's elements or state are given at.

    Raises:
        InputError: a malformed TLE or date.
    """
    if orbit.tle is not None:
        return Tle(orbit.tle).epoch
    given = orbit.elements or orbit.state_eci
    assert given is not None  # the model has exactly one of the three
    return Epoch.from_iso(given.epoch_utc)


def orbit_period_s(orbit: OrbitConfig, constants: Constants) -> float:
    """Period of the target: by a TLE's own mean motion, else by the osculating semi-major axis.

    Raises:
        InputError: as :func:`target_state`; a hyperbolic orbit has no period.
    """
    if orbit.tle is not None:
        return 2 * math.pi / Tle(orbit.tle).mean.mean_motion_rad_s
    r_m, v_m_s = target_state(orbit, constants)
    a_m = 1 / (2 / np.linalg.norm(r_m) - v_m_s @ v_m_s / constants.mu_earth_m3_s2)
    return 2 * math.pi * math.sqrt(a_m**3 / constants.mu_earth_m3_s2)


def target_state(
    orbit: OrbitConfig, constants: Constants, *, elliptic: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Osculating position (3,) m and velocity (3,) m/s at the epoch, GCRF axes.

    Args:
        elliptic: refuse a hyperbolic orbit.

    Raises:
        InputError: malformed TLE, hyperbolic orbit, rectilinear orbit, or one whose perigee is below
            the Earth's surface.
    """
    if orbit.tle is not None:
        r, v = Tle(orbit.tle).state(np.zeros(1))
        r_m, v_m_s, where = r[0], v[0], "orbit.tle"
    elif orbit.elements is not None:
        k = orbit.elements
        angles_deg = (k.i_deg, k.raan_deg, k.argp_deg, k.mean_anomaly_deg)
        row = np.array([k.a_m, k.e, *np.radians(angles_deg)])
        r_m, v_m_s = elements.state_from_keplerian(row, constants.mu_earth_m3_s2)
        where = "orbit.elements"
    else:
        assert orbit.state_eci is not None  # the model has exactly one of the three
        r_m, v_m_s = np.array(orbit.state_eci.r_m), np.array(orbit.state_eci.v_m_s)
        where = "orbit.state_eci"
    check_orbit(r_m, v_m_s, constants, where, elliptic=elliptic)
    return r_m, v_m_s


def check_orbit(
    r_m: FloatArray, v_m_s: FloatArray, constants: Constants, where: str, *, elliptic: bool
) -> None:
    """Refuse what is no orbit, meets the Earth, or, where ``elliptic``, escapes.

    Raises:
        InputError: one line that begins with ``where``.
    """
    mu = constants.mu_earth_m3_s2
    r = float(np.linalg.norm(r_m))
    if not np.isfinite(r) or r == 0 or not np.all(np.isfinite(v_m_s)):
        raise InputError(f"{where}: this is not an orbit; check the numbers and their units")
    v2 = float(v_m_s @ v_m_s)
    h2 = r**2 * v2 - float(r_m @ v_m_s) ** 2
    energy = v2 / 2 - mu / r
    e = math.sqrt(max(0.0, 1 + 2 * energy * h2 / mu**2))
    perigee_m = h2 / mu / (1 + e)
    if perigee_m < constants.earth_radius_m:
        raise InputError(
            f"{where}: the orbit's perigee is {(constants.earth_radius_m - perigee_m) / 1e3:.6g} km"
            " below the Earth's surface; check the units (m, m/s)"
        )
    if elliptic and energy >= 0:
        raise InputError(f"{where}: the orbit is not elliptic (e = {e:.6g}); take propagator nonlinear")
