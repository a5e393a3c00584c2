"""Propagator ``j2-roe``: ROE with the secular and short-period effects of J2, in closed form."""

from __future__ import annotations

import math

from posse_core._arrays import FloatArray
from posse_core._dynamics.domain import warn_if_far_off
from posse_core._dynamics.elements import state_from_qns
from posse_core._dynamics.j2 import j2_secular, j2_stm, mean_from_osculating, osculating_from_mean
from posse_core._dynamics.roe import qns_from_roe, roe_from_qns, rtn_from_roe
from posse_core._dynamics.start import Start
from posse_core._errors import InputError
from posse_core._frames import by_plane_turn
from posse_core._interfaces.propagator import Flight, FlightPropagator, PropagationProblem
from posse_core._propagators.options import J2RoeOptions

_CRITICAL_RAD = math.radians(1.0)


class J2RoePropagator(FlightPropagator[J2RoeOptions]):
    """Propagates mean ROE by the state-transition matrix of Koenig, Guffanti and D'Amico.

    Osculating elements are converted to mean ones before and back after, and the RTN states follow by
    the exact map. The inclination must not be 0° or 180°, where these ROE are singular, and for Brouwer
    and Lyddane's mean elements not within 1° of 63.43° or 116.57°.
    """

    turns_plane = True

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        constants, mu = problem.constants, start.target.mu_m3_s2
        theory = self.options.mean_elements
        if theory == "brouwer-lyddane":
            _refuse_critical(float(start.target.qns[4]))
        deputy_qns = qns_from_roe(start.target.qns, start.roe)
        chief_0 = mean_from_osculating(start.target.qns, constants, theory)
        deputy_0 = mean_from_osculating(deputy_qns, constants, theory)
        roe_0 = roe_from_qns(chief_0, deputy_0)
        chief = j2_secular(chief_0, constants, after_s)
        linear = qns_from_roe(chief, j2_stm(chief_0, constants, after_s) @ roe_0)
        chief_osculating = osculating_from_mean(chief, constants, theory)

        def rtn(deputy_mean: FloatArray) -> FloatArray:
            roe = roe_from_qns(chief_osculating, osculating_from_mean(deputy_mean, constants, theory))
            return rtn_from_roe(chief_osculating, roe, mu, 0.0)

        states = rtn(linear)
        whole = rtn(j2_secular(deputy_0, constants, after_s))
        warn_if_far_off("j2-roe", states[:, :3], whole[:, :3], "linear in the separation", "nonlinear")
        r, v = state_from_qns(chief_osculating, mu)
        states[:, 3:] -= by_plane_turn(start.target.plane_turn_rad_s(r, v), states[:, :3])
        return Flight(r, v, states)


def _refuse_critical(i_rad: float) -> None:
    critical = math.acos(math.sqrt(0.2))
    if min(abs(i_rad - critical), abs(math.pi - i_rad - critical)) < _CRITICAL_RAD:
        raise InputError(
            f"propagator j2-roe: Brouwer's mean elements are singular near an inclination of"
            f" {math.degrees(i_rad):.4g}°; set propagator.mean_elements to canonical, or take"
            " propagator nonlinear"
        )
