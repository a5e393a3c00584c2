"""Propagators ``hcw``, ``roe-near-circular`` and ``yamanaka-ankersen``: linear two-body motion.

Each starts from the exact state or ROE at the epoch, so its error is its own linearisation's. That
error is computed against the exact motion, and told when it is above 1 % of the separation.
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
    """What the three share."""

    name: ClassVar[str]
    instead: ClassVar[str]

    @abstractmethod
    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        """(F,) → (F, 6) the chaser's RTN state by the model."""

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        rtn = self.rtn(start, after_s)
        e = float(np.hypot(*start.target.equinoctial[2:4]))
        exact = exact_rtn([start], after_s)[0]
        warn_if_far_off(self.name, rtn[:, :3], exact[:, :3], f"e = {e:.3g}", self.instead)
        return two_body_flight(start, after_s, rtn)


class HcwPropagator(LinearPropagator):
    """Hill–Clohessy–Wiltshire: circular target, small separation."""

    name = "hcw"
    instead = "yamanaka-ankersen or roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(hcw_stm(start.target.qns, start.target.mu_m3_s2, t_s) @ start.rtn)


class NearCircularPropagator(LinearPropagator):
    """ROE mapped by T(u), u = ω + M: errs by about e times the separation."""

    name = "roe-near-circular"
    instead = "roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(near_circular_map(start.target.qns, start.target.mu_m3_s2, t_s) @ start.roe)


class YamanakaAnkersenPropagator(LinearPropagator):
    """Yamanaka–Ankersen: any eccentricity, small separation."""

    name = "yamanaka-ankersen"
    instead = "roe"

    def rtn(self, start: Start, t_s: FloatArray) -> FloatArray:
        return np.asarray(
            yamanaka_ankersen_stm(start.target.qns, start.target.mu_m3_s2, t_s) @ start.rtn
        )
