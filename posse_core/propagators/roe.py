"""Propagator ``roe``: exact relative two-body motion by relative orbital elements (the default)."""

from __future__ import annotations

import numpy as np

from posse_core.dynamics.elements import later, state_from_equinoctial
from posse_core.dynamics.orbit import Start
from posse_core.dynamics.roe import rtn_from_equinoctial_roe
from posse_core.interfaces.propagator import PropagationProblem, Propagator
from posse_core.model.trajectory import Motion


class RoePropagator(Propagator):
    """Both orbits by Kepler's equation, differenced in the target's RTN axes; any e < 1, any i."""

    def propagate(self, problem: PropagationProblem) -> Motion:
        start = Start(problem)
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        mu = problem.constants.mu_earth_m3_s2
        chief, sign = start.chief_equinoctial, start.sign
        r_target, v_target = state_from_equinoctial(later(chief, mu, t_s), sign, mu)
        rtn = rtn_from_equinoctial_roe(chief, sign, start.roe_equinoctial, mu, t_s)
        return Motion(
            t_s=t_s,
            r_target_eci_m=r_target,
            v_target_eci_m_s=v_target,
            r_chaser_rtn_m=rtn[:, :3],
            v_chaser_rtn_m_s=rtn[:, 3:],
            sequence=np.zeros(len(t_s), dtype=np.int64),
        )
