"""Propagators ``hcw``, ``roe-near-circular`` and ``yamanaka-ankersen``: linear two-body motion.

Each starts from the exact state or ROE at the epoch, so its error is that of its linearisation. The
error is computed by comparison with the exact motion, and a warning reports it when it is above 1 % of
the separation.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.domain import warn_if_far_off
from posse_core._dynamics.linear import hcw_stm, near_circular_map, yamanaka_ankersen_stm
from posse_core._dynamics.start import Start
from posse_core._interfaces.propagator import Flight, FlightPropagator, PropagationProblem
from posse_core._propagators.roe import exact_rtn, two_body_flight


class LinearPropagator(FlightPropagator):
    """Base class of the three propagators.

    Attributes:
        name: the propagator's name.
        instead: the propagators that a warning recommends.
    """

    name: ClassVar[str]
    instead: ClassVar[str]

    @abstractmethod
    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        """(F,) → (F, 6): the chaser's RTN state by the linear model."""

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        rtn = self.rtn(start, after_s)
        e = float(np.hypot(*start.target.equinoctial[2:4]))
        exact = exact_rtn([start], after_s)[0]
        warn_if_far_off(self.name, rtn[:, :3], exact[:, :3], f"e = {e:.3g}", self.instead)
        return two_body_flight(start, after_s, rtn)


class HcwPropagator(LinearPropagator):
    """Hill–Clohessy–Wiltshire equations, for a circular target orbit and a small separation."""

    name = "hcw"
    instead = "yamanaka-ankersen or roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(hcw_stm(start.target.qns, start.target.mu_m3_s2, t_s) @ start.rtn)


class NearCircularPropagator(LinearPropagator):
    """ROE mapped to RTN by T(u), u = ω + M; the error is about e times the separation."""

    name = "roe-near-circular"
    instead = "roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(near_circular_map(start.target.qns, start.target.mu_m3_s2, t_s) @ start.roe)


class YamanakaAnkersenPropagator(LinearPropagator):
    """Yamanaka–Ankersen equations, for any eccentricity and a small separation."""

    name = "yamanaka-ankersen"
    instead = "roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(
            yamanaka_ankersen_stm(start.target.qns, start.target.mu_m3_s2, t_s) @ start.rtn
        )
