"""Where target and chaser are at one instant, in whatever form a model wants them."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics import elements, roe
from posse_core._dynamics.orbit import check_orbit
from posse_core._errors import InputError

SINGULAR_SIN_I = 1e-6
"""Below this sine of the inclination (0.2″) the node is lost to rounding, and with it δλ and δi."""


class Target:
    """A target at one instant; several chasers may share it.

    Attributes:
        r_eci_m, v_eci_m_s: (3,) GCRF axes.
    """

    def __init__(self, r_eci_m: FloatArray, v_eci_m_s: FloatArray, constants: Constants) -> None:
        self.r_eci_m, self.v_eci_m_s = r_eci_m, v_eci_m_s
        self.constants = constants
        self.mu_m3_s2 = constants.mu_earth_m3_s2
        self._flown: tuple[FloatArray, tuple[FloatArray, FloatArray]] | None = None

    @cached_property
    def sign(self) -> float:
        """I of the equinoctial set, +1 or −1."""
        return float(elements.equinoctial_sign(self.r_eci_m, self.v_eci_m_s))

    @cached_property
    def equinoctial(self) -> FloatArray:
        """(6,) osculating equinoctial elements."""
        return elements.equinoctial_from_state(self.r_eci_m, self.v_eci_m_s, self.sign, self.mu_m3_s2)

    @cached_property
    def qns(self) -> FloatArray:
        """(6,) osculating quasi-nonsingular elements."""
        return elements.qns_from_equinoctial(self.equinoctial, self.sign)

    def two_body(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position (m) and velocity (m/s) after (F,) seconds by Kepler's laws: (F, 3) each.

        The last answer is kept: chasers of one target ask for the same times.
        """
        if self._flown is None or not np.array_equal(self._flown[0], t_s):
            later = elements.later(self.equinoctial, self.mu_m3_s2, t_s)
            state = elements.state_from_equinoctial(later, self.sign, self.mu_m3_s2)
            self._flown = (np.array(t_s), state)
        return self._flown[1]

    @cached_property
    def R_eci_from_rtn(self) -> FloatArray:
        """(3, 3)."""
        return frames.R_eci_from_rtn(self.r_eci_m, self.v_eci_m_s)

    @cached_property
    def spin_rad_s(self) -> float:
        """Angular velocity of the RTN frame about N."""
        return float(frames.rtn_rate_rad_s(self.r_eci_m, self.v_eci_m_s))


class Start:
    """A target, and a chaser given by one of the keyword arguments.

    Args:
        where: key of the scenario that messages name.
        elliptic: refuse hyperbolic orbits.
        rtn: (6,) RTN position (m) and velocity (m/s, rotating frame).
        apart_eci: (6,) chaser minus target, GCRF axes, m and m/s.
        roe_m, roe_equinoctial_m: (6,) a times quasi-nonsingular, equinoctial ROE.

    Attributes:
        dr_eci_m, dv_eci_m_s: (3,) chaser minus target, GCRF axes.

    Raises:
        InputError: an orbit that :func:`posse_core._dynamics.orbit.check_orbit` refuses, of the
            chaser; or ``roe_m`` at an inclination of 0° or 180°.
    """

    def __init__(
        self,
        target: Target,
        where: str,
        *,
        elliptic: bool = True,
        rtn: FloatArray | None = None,
        apart_eci: FloatArray | None = None,
        roe_m: FloatArray | None = None,
        roe_equinoctial_m: FloatArray | None = None,
    ) -> None:
        self.target = target
        self._given_roe_m, self._given_equinoctial_m = roe_m, roe_equinoctial_m
        if rtn is not None:
            self.rtn = rtn
        if apart_eci is None:
            R, r_rtn, v_rtn = target.R_eci_from_rtn, self.rtn[:3], self.rtn[3:]
            apart_eci = np.concatenate(
                [R @ r_rtn, R @ (v_rtn + target.spin_rad_s * np.array([-r_rtn[1], r_rtn[0], 0.0]))]
            )
        self.dr_eci_m, self.dv_eci_m_s = apart_eci[:3], apart_eci[3:]
        check_orbit(
            target.r_eci_m + self.dr_eci_m,
            target.v_eci_m_s + self.dv_eci_m_s,
            target.constants,
            where,
            elliptic=elliptic,
        )

    @cached_property
    def rtn(self) -> FloatArray:
        """(6,) chaser's RTN position (m) and velocity (m/s, rotating frame)."""
        t = self.target
        if self._given_roe_m is not None:
            return roe.rtn_from_roe(t.qns, self.roe, t.mu_m3_s2, 0.0)
        if self._given_equinoctial_m is not None:
            return roe.rtn_from_equinoctial_roe(
                t.equinoctial, t.sign, self.roe_equinoctial, t.mu_m3_s2, 0.0
            )
        r, v = t.r_eci_m, t.v_eci_m_s
        return np.concatenate(frames.rtn_from_eci(r, v, r + self.dr_eci_m, v + self.dv_eci_m_s))

    @cached_property
    def roe_equinoctial(self) -> FloatArray:
        """(6,) dimensionless equinoctial ROE."""
        if self._given_equinoctial_m is not None:
            return np.asarray(self._given_equinoctial_m / self.target.equinoctial[0])
        if self._given_roe_m is not None:
            return roe.equinoctial_roe_from_roe(self.target.qns, self.roe, self.target.sign)
        return roe.equinoctial_roe_from_states(
            self.target.r_eci_m,
            self.target.v_eci_m_s,
            self.dr_eci_m,
            self.dv_eci_m_s,
            self.target.sign,
            self.target.mu_m3_s2,
        )

    @cached_property
    def roe(self) -> FloatArray:
        """(6,) dimensionless quasi-nonsingular ROE.

        Raises:
            InputError: the target's inclination is 0° or 180°.
        """
        i_rad = float(self.target.qns[4])
        if math.sin(i_rad) < SINGULAR_SIN_I:
            raise InputError(
                f"quasi-nonsingular relative elements mean nothing at an inclination of"
                f" {math.degrees(i_rad):.6g}°; give relative.roe_equinoctial_m, state_rtn or"
                " state_eci, with propagator roe or nonlinear"
            )
        if self._given_roe_m is not None:
            return np.asarray(self._given_roe_m / self.target.qns[0])
        deputy = self.target.equinoctial + self.roe_equinoctial
        deputy[0] = self.target.equinoctial[0] * (1 + self.roe_equinoctial[0])
        result = roe.roe_from_qns(
            self.target.qns, elements.qns_from_equinoctial(deputy, self.target.sign)
        )
        result[0] = self.roe_equinoctial[0]
        return result
