"""States of target and chaser at one instant, in all the forms that motion models need."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics import elements, roe
from posse_core._dynamics.orbit import check_orbit, plane_turn_rad_s
from posse_core._errors import InputError

SINGULAR_SIN_I = 1e-6
"""Below this sine of the inclination (0.2″), rounding makes the node and so δλ and δi meaningless."""


class Target:
    """A target at one instant; several chasers may share it.

    Args:
        r_eci_m, v_eci_m_s: (3,) geocentric position and velocity, GCRF axes.
        constants: gravity and radii.
        t_s: seconds from the epoch of the problem to this instant.
        where: what messages call the target, such as the key of a scenario.
        turns_plane: whether velocities in RTN are in axes that turn with the orbit's plane under J2, as
            under a propagator that has J2.

    Attributes:
        mu_m3_s2: the Earth's gravitational parameter. The arguments are attributes too.
    """

    def __init__(
        self,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        constants: Constants,
        *,
        t_s: float = 0.0,
        where: str = "the target",
        turns_plane: bool = False,
    ) -> None:
        self.r_eci_m = np.asarray(r_eci_m, dtype=np.float64)
        self.v_eci_m_s = np.asarray(v_eci_m_s, dtype=np.float64)
        self.constants = constants
        self.mu_m3_s2 = constants.mu_earth_m3_s2
        self.t_s, self.where, self.turns_plane = t_s, where, turns_plane
        self._flown: tuple[FloatArray, tuple[FloatArray, FloatArray]] | None = None

    def check(self, *, elliptic: bool) -> None:
        """Check that the state is an orbit above the Earth's surface and, if ``elliptic``, an ellipse.

        Raises:
            InputError: It is not; the message begins with :attr:`where`.
        """
        check_orbit(self.r_eci_m, self.v_eci_m_s, self.constants, self.where, elliptic=elliptic)

    @cached_property
    def sign(self) -> float:
        """Retrograde factor I of the equinoctial elements, +1 or −1."""
        return float(elements.equinoctial_sign(self.r_eci_m, self.v_eci_m_s))

    @cached_property
    def equinoctial(self) -> FloatArray:
        """(6,) osculating equinoctial elements.

        Raises:
            InputError: the orbit is not elliptic.
        """
        self.check(elliptic=True)
        return elements.equinoctial_from_state(self.r_eci_m, self.v_eci_m_s, self.sign, self.mu_m3_s2)

    @cached_property
    def qns(self) -> FloatArray:
        """(6,) osculating quasi-nonsingular elements: a (m), ω + M (rad), ex, ey, i, Ω (rad).

        Raises:
            InputError: the orbit is not elliptic.
        """
        return elements.qns_from_equinoctial(self.equinoctial, self.sign)

    def two_body(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position (m) and velocity (m/s) after (F,) seconds of two-body motion: (F, 3) each.

        The last result is cached, since all chasers of one target need the same times.
        """
        if self._flown is None or not np.array_equal(self._flown[0], t_s):
            later = elements.later(self.equinoctial, self.mu_m3_s2, t_s)
            state = elements.state_from_equinoctial(later, self.sign, self.mu_m3_s2)
            self._flown = (np.array(t_s), state)
        return self._flown[1]

    @cached_property
    def R_eci_from_rtn(self) -> FloatArray:
        """(3, 3) rotation from the target's RTN axes to GCRF axes."""
        return frames.R_eci_from_rtn(self.r_eci_m, self.v_eci_m_s)

    def plane_turn_rad_s(self, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
        """Rate (...) at which the plane turns about R where the target is at (..., 3) and (..., 3)."""
        if not self.turns_plane:
            return np.zeros(np.shape(r_eci_m)[:-1])
        return plane_turn_rad_s(r_eci_m, v_eci_m_s, self.constants)

    @cached_property
    def spin_rtn_rad_s(self) -> FloatArray:
        """(3,) angular velocity of the target's RTN axes, RTN components."""
        turn = self.plane_turn_rad_s(self.r_eci_m, self.v_eci_m_s)
        return frames.rtn_spin_rad_s(self.r_eci_m, self.v_eci_m_s, turn)

    def in_turning_axes(self, rtn: FloatArray) -> FloatArray:
        """(6,) an RTN state whose velocity leaves out the turn of the plane → with that of the axes."""
        turn = self.spin_rtn_rad_s[0]
        return np.concatenate([rtn[:3], rtn[3:] - frames.by_plane_turn(turn, rtn[:3])])


class Start:
    """The states of a target and its chaser at the same instant.

    It is made by :meth:`from_rtn`, :meth:`from_eci`, :meth:`from_roe` or :meth:`from_equinoctial_roe`.
    The form that was given is kept unchanged to the bit; the others are computed from it when they are
    first used.

    Attributes:
        target: the target, whose instant is that of the start.
        dr_eci_m, dv_eci_m_s: (3,) chaser minus target, GCRF axes, m and m/s.
        where: what messages call the chaser, such as the key of a scenario.
    """

    def __init__(
        self, target: Target, dr_eci_m: FloatArray, dv_eci_m_s: FloatArray, *, where: str = "the chaser"
    ) -> None:
        self.target, self.where = target, where
        self.dr_eci_m, self.dv_eci_m_s = dr_eci_m, dv_eci_m_s
        self.check(elliptic=False)

    @classmethod
    def from_eci(
        cls,
        target: Target,
        r_eci_m: FloatArray,
        v_eci_m_s: FloatArray,
        *,
        where: str = "the chaser",
    ) -> Start:
        """Make a start from the chaser's geocentric state, (3,) m and (3,) m/s, GCRF axes.

        Raises:
            InputError: The state is not an orbit, or its perigee is below the Earth's surface.
        """
        return cls(target, r_eci_m - target.r_eci_m, v_eci_m_s - target.v_eci_m_s, where=where)

    @classmethod
    def from_rtn(
        cls,
        target: Target,
        r_rtn_m: FloatArray,
        v_rtn_m_s: FloatArray,
        *,
        where: str = "the chaser",
    ) -> Start:
        """Make a start from the relative state in the target's RTN axes, (3,) m and (3,) m/s.

        The velocity is the derivative of the position in the rotating RTN axes.

        Raises:
            InputError: The chaser's state is not an orbit, or its perigee is below the Earth's surface.
        """
        r_rtn, v_rtn = np.asarray(r_rtn_m, dtype=np.float64), np.asarray(v_rtn_m_s, dtype=np.float64)
        R = target.R_eci_from_rtn
        turning = np.cross(target.spin_rtn_rad_s, r_rtn)
        start = cls(target, R @ r_rtn, R @ (v_rtn + turning), where=where)
        start.rtn = np.concatenate([r_rtn, v_rtn])
        return start

    @classmethod
    def from_roe(cls, target: Target, roe_m: FloatArray, *, where: str = "the chaser") -> Start:
        """Make a start from quasi-nonsingular relative orbital elements times the semi-major axis.

        Args:
            target: the target.
            roe_m: (6,) a·(δa, δλ, δex, δey, δix, δiy), m, where a is the target's semi-major axis.
            where: what messages call the chaser.

        Raises:
            InputError: An orbit is not elliptic or has its perigee below the Earth's surface, or the
                target's inclination is 0° or 180°, where these elements are singular.
        """
        given = np.asarray(roe_m, dtype=np.float64)
        chief = target.qns
        _refuse_singular(chief)
        small = given / chief[0]
        rtn = target.in_turning_axes(roe.rtn_from_roe(chief, small, target.mu_m3_s2, 0.0))
        start = cls.from_rtn(target, rtn[:3], rtn[3:], where=where)
        start.roe_m, start.roe = given, small
        start.roe_equinoctial = roe.equinoctial_roe_from_roe(chief, small, target.sign)
        return start

    @classmethod
    def from_equinoctial_roe(
        cls, target: Target, roe_m: FloatArray, *, where: str = "the chaser"
    ) -> Start:
        """Make a start from equinoctial relative orbital elements times the semi-major axis.

        These elements are regular at every inclination.

        Args:
            target: the target.
            roe_m: (6,) a·(δa, δl, δex, δey, δp, δq), m, where a is the target's semi-major axis.
            where: what messages call the chaser.

        Raises:
            InputError: An orbit is not elliptic or has its perigee below the Earth's surface.
        """
        chief = target.equinoctial
        small = np.asarray(roe_m, dtype=np.float64) / chief[0]
        kepler = roe.rtn_from_equinoctial_roe(chief, target.sign, small, target.mu_m3_s2, 0.0)
        rtn = target.in_turning_axes(kepler)
        start = cls.from_rtn(target, rtn[:3], rtn[3:], where=where)
        start.roe_equinoctial = small
        return start

    def check(self, *, elliptic: bool) -> None:
        """Check that the chaser's orbit is above the Earth's surface and, if ``elliptic``, an ellipse.

        Raises:
            InputError: It is not; the message begins with :attr:`where`.
        """
        check_orbit(
            self.target.r_eci_m + self.dr_eci_m,
            self.target.v_eci_m_s + self.dv_eci_m_s,
            self.target.constants,
            self.where,
            elliptic=elliptic,
        )

    @cached_property
    def rtn(self) -> FloatArray:
        """(6,) the chaser's RTN position (m) and velocity (m/s, derivative in the rotating axes)."""
        r, v, turn = self.target.r_eci_m, self.target.v_eci_m_s, self.target.spin_rtn_rad_s[0]
        return np.concatenate(frames.rtn_from_eci(r, v, r + self.dr_eci_m, v + self.dv_eci_m_s, turn))

    @cached_property
    def roe_equinoctial(self) -> FloatArray:
        """(6,) dimensionless equinoctial ROE.

        Raises:
            InputError: an orbit is not elliptic.
        """
        self.target.check(elliptic=True)
        self.check(elliptic=True)
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
            InputError: an orbit is not elliptic, or the target's inclination is 0° or 180°.
        """
        chief = self.target.qns
        _refuse_singular(chief)
        deputy = self.target.equinoctial + self.roe_equinoctial
        deputy[0] = self.target.equinoctial[0] * (1 + self.roe_equinoctial[0])
        result = roe.roe_from_qns(chief, elements.qns_from_equinoctial(deputy, self.target.sign))
        result[0] = self.roe_equinoctial[0]
        return result

    @cached_property
    def roe_m(self) -> FloatArray:
        """(6,) quasi-nonsingular ROE times the target's semi-major axis, m.

        Raises:
            InputError: See :attr:`roe`.
        """
        return np.asarray(self.roe * self.target.qns[0])


def _refuse_singular(chief_qns: FloatArray) -> None:
    i_rad = float(chief_qns[4])
    if math.sin(i_rad) < SINGULAR_SIN_I:
        raise InputError(
            f"quasi-nonsingular relative elements are singular at an inclination of"
            f" {math.degrees(i_rad):.6g}°; give relative.roe_equinoctial_m, state_rtn or"
            " state_eci, with propagator roe or nonlinear"
        )
