"""Where target and chaser are at one instant, in whatever form a model wants them."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from posse_core import frames
from posse_core.constants import Constants
from posse_core.dynamics import elements, roe
from posse_core.dynamics.orbit import check_orbit
from posse_core.errors import InputError
from posse_core.model.arrays import FloatArray

SINGULAR_SIN_I = 1e-6
"""Below this sine of the inclination (0.2″) the node is lost to rounding, and with it δλ and δi."""


class Start:
    """A target, and a chaser given by one of the keyword arguments.

    Args:
        r_target_eci_m, v_target_eci_m_s: (3,) GCRF axes.
        where: key of the scenario that messages name.
        elliptic: refuse hyperbolic orbits.
        rtn: (6,) RTN position (m) and velocity (m/s, rotating frame).
        apart_eci: (6,) chaser minus target, GCRF axes, m and m/s.
        roe_m, roe_equinoctial_m: (6,) a times quasi-nonsingular, equinoctial ROE.

    Attributes:
        dr_eci_m, dv_eci_m_s: (3,) chaser minus target, GCRF axes.

    Raises:
        InputError: an orbit that :func:`posse_core.dynamics.orbit.check_orbit` refuses, of the
            chaser; or ``roe_m`` at an inclination of 0° or 180°.
    """

    def __init__(
        self,
        r_target_eci_m: FloatArray,
        v_target_eci_m_s: FloatArray,
        constants: Constants,
        where: str,
        *,
        elliptic: bool = True,
        rtn: FloatArray | None = None,
        apart_eci: FloatArray | None = None,
        roe_m: FloatArray | None = None,
        roe_equinoctial_m: FloatArray | None = None,
    ) -> None:
        self.constants = constants
        self.mu_m3_s2 = constants.mu_earth_m3_s2
        self.r_target_eci_m, self.v_target_eci_m_s = r_target_eci_m, v_target_eci_m_s
        self._given_roe_m, self._given_equinoctial_m = roe_m, roe_equinoctial_m
        if rtn is not None:
            self.rtn = rtn
        if apart_eci is None:
            R = frames.R_eci_from_rtn(r_target_eci_m, v_target_eci_m_s)
            spin = np.array([0.0, 0.0, frames.rtn_rate_rad_s(r_target_eci_m, v_target_eci_m_s)])
            apart_eci = np.concatenate(
                [R @ self.rtn[:3], R @ (self.rtn[3:] + np.cross(spin, self.rtn[:3]))]
            )
        self.dr_eci_m, self.dv_eci_m_s = apart_eci[:3], apart_eci[3:]
        check_orbit(
            r_target_eci_m + self.dr_eci_m,
            v_target_eci_m_s + self.dv_eci_m_s,
            constants,
            where,
            elliptic=elliptic,
        )

    @cached_property
    def rtn(self) -> FloatArray:
        """(6,) chaser's RTN position (m) and velocity (m/s, rotating frame)."""
        mu = self.mu_m3_s2
        if self._given_roe_m is not None:
            return roe.rtn_from_roe(self.chief_qns, self.roe, mu, 0.0)
        if self._given_equinoctial_m is not None:
            return roe.rtn_from_equinoctial_roe(
                self.chief_equinoctial, self.sign, self.roe_equinoctial, mu, 0.0
            )
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
        if self._given_equinoctial_m is not None:
            return np.asarray(self._given_equinoctial_m / self.chief_equinoctial[0])
        if self._given_roe_m is not None:
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
        """(6,) dimensionless quasi-nonsingular ROE.

        Raises:
            InputError: the target's inclination is 0° or 180°.
        """
        i_rad = float(self.chief_qns[4])
        if math.sin(i_rad) < SINGULAR_SIN_I:
            raise InputError(
                f"quasi-nonsingular relative elements mean nothing at an inclination of"
                f" {math.degrees(i_rad):.6g}°; give relative.roe_equinoctial_m, state_rtn or"
                " state_eci, with propagator roe or nonlinear"
            )
        if self._given_roe_m is not None:
            return np.asarray(self._given_roe_m / self.chief_qns[0])
        deputy = self.chief_equinoctial + self.roe_equinoctial
        deputy[0] = self.chief_equinoctial[0] * (1 + self.roe_equinoctial[0])
        result = roe.roe_from_qns(self.chief_qns, elements.qns_from_equinoctial(deputy, self.sign))
        result[0] = self.roe_equinoctial[0]
        return result
