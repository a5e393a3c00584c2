"""From the scenario's keys to states: where target and chaser are at the epoch."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from posse_core import frames
from posse_core.constants import Constants
from posse_core.dynamics import elements, roe
from posse_core.dynamics.tle import Tle
from posse_core.environment.time import Epoch
from posse_core.errors import InputError
from posse_core.interfaces.propagator import PropagationProblem
from posse_core.model.arrays import FloatArray
from posse_core.scenario.orbit import OrbitConfig

SINGULAR_SIN_I = 1e-6
"""Below this sine of the inclination (0.2″) the node is lost to rounding, and with it δλ and δi."""


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
    _check_orbit(r_m, v_m_s, constants, where, elliptic=elliptic)
    return r_m, v_m_s


class Start:
    """Target and chaser at t = 0, in whatever form a model wants them.

    Attributes:
        r_target_eci_m, v_target_eci_m_s: (3,) GCRF axes.
        dr_eci_m, dv_eci_m_s: (3,) chaser minus target, GCRF axes.

    Raises:
        InputError: an orbit that :func:`target_state` refuses, of target or chaser; or
            ``relative.roe_m`` at an inclination of 0° or 180°.
    """

    def __init__(self, problem: PropagationProblem, *, elliptic: bool = True) -> None:
        self._relative = problem.relative
        constants = problem.constants
        self.mu_m3_s2 = constants.mu_earth_m3_s2
        needs_elements = self._relative.roe_m is not None
        r, v = target_state(problem.orbit, constants, elliptic=elliptic or needs_elements)
        self.r_target_eci_m, self.v_target_eci_m_s = r, v
        if self._relative.state_eci is not None:
            self.dr_eci_m = np.array(self._relative.state_eci.r_m) - r
            self.dv_eci_m_s = np.array(self._relative.state_eci.v_m_s) - v
        else:
            R = frames.R_eci_from_rtn(r, v)
            spin = np.array([0.0, 0.0, frames.rtn_rate_rad_s(r, v)])
            r_rtn, v_rtn = self.rtn[:3], self.rtn[3:]
            self.dr_eci_m = R @ r_rtn
            self.dv_eci_m_s = R @ (v_rtn + np.cross(spin, r_rtn))
        where = "relative." + next(k for k, value in self._relative if value is not None)
        _check_orbit(r + self.dr_eci_m, v + self.dv_eci_m_s, constants, where, elliptic=elliptic)

    @cached_property
    def rtn(self) -> FloatArray:
        """(6,) chaser's RTN position and velocity (rotating frame)."""
        given = self._relative
        if given.state_rtn is not None:
            return np.array([*given.state_rtn.r_m, *given.state_rtn.v_m_s])
        if given.roe_m is not None:
            return np.asarray(roe.rtn_from_roe(self.chief_qns, self.roe, self.mu_m3_s2, 0.0))
        r, v = self.r_target_eci_m, self.v_target_eci_m_s
        return np.concatenate(frames.rtn_from_eci(r, v, r + self.dr_eci_m, v + self.dv_eci_m_s))

    @cached_property
    def sign(self) -> float:
        """I of the equinoctial set, +1 or −1, by the target."""
        return float(elements.equinoctial_sign(self.r_target_eci_m, self.v_target_eci_m_s))

    @cached_property
    def chief_equinoctial(self) -> FloatArray:
        """(6,) the target's osculating equinoctial elements."""
        return elements.equinoctial_from_state(
            self.r_target_eci_m, self.v_target_eci_m_s, self.sign, self.mu_m3_s2
        )

    @cached_property
    def chief_qns(self) -> FloatArray:
        """(6,) the target's osculating quasi-nonsingular elements."""
        return elements.qns_from_equinoctial(self.chief_equinoctial, self.sign)

    @cached_property
    def roe_equinoctial(self) -> FloatArray:
        """(6,) dimensionless equinoctial ROE."""
        if self._relative.roe_m is not None:
            return roe.equinoctial_roe_from_roe(self.chief_qns, self.roe, self.sign)
        return roe.equinoctial_roe_from_states(
            self.r_target_eci_m,
            self.v_target_eci_m_s,
            self.dr_eci_m,
            self.dv_eci_m_s,
            self.sign,
            self.mu_m3_s2,
        )

    @cached_property
    def roe(self) -> FloatArray:
        """(6,) dimensionless quasi-nonsingular ROE."""
        i_rad = float(self.chief_qns[4])
        if math.sin(i_rad) < SINGULAR_SIN_I:
            raise InputError(
                f"quasi-nonsingular relative elements mean nothing at an inclination of"
                f" {math.degrees(i_rad):.6g}°; give relative.state_rtn or relative.state_eci"
                " with propagator roe or nonlinear"
            )
        if self._relative.roe_m is not None:
            return np.asarray(np.array(self._relative.roe_m) / self.chief_qns[0])
        deputy = self.chief_equinoctial + self.roe_equinoctial
        deputy[0] = self.chief_equinoctial[0] * (1 + self.roe_equinoctial[0])
        result = roe.roe_from_qns(self.chief_qns, elements.qns_from_equinoctial(deputy, self.sign))
        result[0] = self.roe_equinoctial[0]
        return np.asarray(result)


def _check_orbit(
    r_m: FloatArray, v_m_s: FloatArray, constants: Constants, where: str, *, elliptic: bool
) -> None:
    mu = constants.mu_earth_m3_s2
    r = float(np.linalg.norm(r_m))
    if not np.isfinite(r) or r == 0 or not np.all(np.isfinite(v_m_s)):
        raise InputError(f"{where}: this is not an orbit; check the numbers and their units")
    h2 = float(np.sum(np.cross(r_m, v_m_s) ** 2))
    energy = float(v_m_s @ v_m_s) / 2 - mu / r
    e = math.sqrt(max(0.0, 1 + 2 * energy * h2 / mu**2))
    perigee_m = h2 / mu / (1 + e)
    if perigee_m < constants.earth_radius_m:
        raise InputError(
            f"{where}: the orbit's perigee is {(constants.earth_radius_m - perigee_m) / 1e3:.6g} km"
            " below the Earth's surface; check the units (m, m/s)"
        )
    if elliptic and energy >= 0:
        raise InputError(f"{where}: the orbit is not elliptic (e = {e:.6g}); take propagator nonlinear")
