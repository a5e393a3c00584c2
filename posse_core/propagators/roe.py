"""Propagator ``roe``: exact relative two-body motion by relative orbital elements (the default)."""

from __future__ import annotations

from posse_core.dynamics.roe import rtn_from_equinoctial_roe
from posse_core.dynamics.start import Start
from posse_core.interfaces.propagator import PropagationProblem
from posse_core.model.arrays import FloatArray
from posse_core.propagators.flight import Flight, FlightPropagator


class RoePropagator(FlightPropagator):
    """Both orbits by Kepler's equation, differenced in the target's RTN axes; any e < 1, any i."""

    def fly(
        self, problem: PropagationProblem, start: Start, start_s: float, after_s: FloatArray
    ) -> Flight:
        return two_body_flight(start, after_s, exact_rtn(start, after_s))


def exact_rtn(start: Start, t_s: FloatArray) -> FloatArray:
    """(F,) → (F, 6) the chaser's RTN state, two-body motion without approximation."""
    return rtn_from_equinoctial_roe(
        start.target.equinoctial, start.target.sign, start.roe_equinoctial, start.target.mu_m3_s2, t_s
    )


def two_body_flight(start: Start, t_s: FloatArray, rtn: FloatArray) -> Flight:
    """A relative motion (F, 6) beside a target that moves by Kepler's laws."""
    return Flight(*start.target.two_body(t_s), rtn)
