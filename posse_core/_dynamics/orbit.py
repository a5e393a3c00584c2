"""Checks that a state is an orbit that a spacecraft can fly; and how J2 turns an orbit's plane."""

from __future__ import annotations

import math

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._errors import InputError


def check_orbit(
    r_m: FloatArray, v_m_s: FloatArray, constants: Constants, where: str, *, elliptic: bool
) -> None:
    """Check that a state is an orbit with its perigee above the Earth's surface.

    Args:
        r_m, v_m_s: (3,) geocentric state, inertial axes.
        constants: of the Earth.
        where: what the message calls the state, such as the key of a scenario.
        elliptic: whether a hyperbolic orbit is an error too.

    Raises:
        InputError: The state fails the check; the message begins with ``where``.
    """
    mu = constants.mu_earth_m3_s2
    r = float(np.linalg.norm(r_m))
    if not np.isfinite(r) or r == 0 or not np.all(np.isfinite(v_m_s)):
        raise InputError(f"{where}: the state is not an orbit; check the numbers and their units")
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
        raise InputError(f"{where}: the orbit is not elliptic (e = {e:.6g}); use propagator nonlinear")


def plane_turn_rad_s(r_m: FloatArray, v_m_s: FloatArray, constants: Constants) -> FloatArray:
    """Rate (...) at which J2 turns an orbit's plane about R.

    It is r f_N / |r × v| with the force f_N per mass along N (Battin 1999, section 10.3), at most
    1.5 J2 n (Rₑ/r)².

    Args:
        r_m, v_m_s: (..., 3) geocentric state, inertial axes with z along the Earth's axis.
        constants: of the Earth.
    """
    momentum = np.cross(r_m, v_m_s)
    h2 = np.sum(momentum**2, axis=-1)
    strength = -3 * constants.j2 * constants.mu_earth_m3_s2 * constants.earth_radius_m**2
    r2 = np.sum(np.asarray(r_m) ** 2, axis=-1)
    return np.asarray(strength * r_m[..., 2] * momentum[..., 2] / (r2**2 * h2))
