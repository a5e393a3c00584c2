"""Propagator ``roe``: exact relative two-body motion by relative orbital elements (the default)."""

from __future__ import annotations

import numpy as np

from posse_core.dynamics.elements import later, state_from_equinoctial
from posse_core.dynamics.orbit import Start
from posse_core.dynamics.roe import rtn_from_equinoctial_roe
from posse_core.interfaces.propagator import PropagationProblem, Propagator
from posse_core.model.arrays import FloatArray
from posse_core.model.trajectory import Motion


class RoePropagator(Propagator):
    """Both orbits by Kepler's equation, differenced in the target's RTN axes; any e < 1, any i."""

    def propagate(self, problem: PropagationProblem) -> Motion:
        start = Start(problem)
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        return two_body_motion(start, t_s, exact_rtn(start, t_s))


def exact_rtn(start: Start, t_s: FloatArray) -> FloatArray:
    """(F,) → (F, 6) the chaser's RTN state, two-body motion without approximation."""
    return rtn_from_equinoctial_roe(
        start.chief_equinoctial, start.sign, start.roe_equinoctial, start.mu_m3_s2, t_s
    )


def two_body_motion(start: Start, t_s: FloatArray, rtn: FloatArray) -> Motion:
    """A relative motion (F, 6) beside a target that moves by Kepler's laws."""
    mu = start.mu_m3_s2
    elements = later(start.chief_equinoctial, mu, t_s)
    r_target, v_target = state_from_equinoctial(elements, start.sign, mu)
    return one_sequence(t_s, r_target, v_target, rtn)


def one_sequence(t_s: FloatArray, r_target: FloatArray, v_target: FloatArray, rtn: FloatArray) -> Motion:
    """A :class:`Motion` of one continuous relative orbit, from (F, 3), (F, 3), (F, 6)."""
    return Motion(
        t_s=t_s,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_chaser_rtn_m=rtn[:, :3],
        v_chaser_rtn_m_s=rtn[:, 3:],
        sequence=np.zeros(len(t_s), dtype=np.int64),
    )
