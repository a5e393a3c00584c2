"""Propagator ``roe``: exact relative two-body motion by relative orbital elements (the default)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.roe import rtn_from_equinoctial_roe
from posse_core._dynamics.start import Start
from posse_core._interfaces.propagator import Flight, FlightPropagator, PropagationProblem


class RoePropagator(FlightPropagator):
    """Solves both orbits by Kepler's equation and takes their difference in the target's RTN axes.

    It is exact for any e < 1 and any inclination.
    """

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        return self.fly_together(problem, [start], after_s)[0]

    def fly_together(
        self, problem: PropagationProblem, starts: Sequence[Start], t_s: FloatArray
    ) -> list[Flight]:
        states = exact_rtn(starts, t_s)
        return [two_body_flight(start, t_s, rtn) for start, rtn in zip(starts, states, strict=True)]


def exact_rtn(starts: Sequence[Start], t_s: FloatArray) -> FloatArray:
    """(F,) → (S, F, 6): RTN states of S chasers of one target, exact two-body motion.

    All chasers are computed in one evaluation, since a call by itself takes about as long as computing
    the states of an orbit.
    """
    target, roe = starts[0].target, np.stack([start.roe_equinoctial for start in starts])
    return rtn_from_equinoctial_roe(target.equinoctial, target.sign, roe[:, None], target.mu_m3_s2, t_s)


def two_body_flight(start: Start, t_s: FloatArray, rtn: FloatArray) -> Flight:
    """Combine a relative motion (F, 6) with the two-body motion of the target."""
    return Flight(*start.target.two_body(t_s), rtn)
