"""Propagator ``sgp4``: target and chaser by SGP4, in GCRF axes."""

from __future__ import annotations

import numpy as np

from posse_core.dynamics.orbit import Start
from posse_core.dynamics.tle import Tle
from posse_core.errors import InputError
from posse_core.frames import rtn_from_eci
from posse_core.interfaces.propagator import PropagationProblem, Propagator
from posse_core.model.trajectory import Motion
from posse_core.propagators.roe import one_sequence


class Sgp4Propagator(Propagator):
    """The chaser has the target's drag, and mean elements that give its state at the epoch.

    SGP4's own rounding and its dated constants leave the relative state uncertain by some mm.
    """

    def propagate(self, problem: PropagationProblem) -> Motion:
        if problem.orbit.tle is None:
            raise InputError("propagator sgp4 starts from orbit.tle; give it, or take propagator roe")
        start = Start(problem)
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        tle = Tle(problem.orbit.tle)
        chaser = tle.neighbour(
            start.r_target_eci_m + start.dr_eci_m, start.v_target_eci_m_s + start.dv_eci_m_s
        )
        r_target, v_target = tle.state(t_s)
        rtn = np.concatenate(rtn_from_eci(r_target, v_target, *chaser.state(t_s)), axis=-1)
        return one_sequence(t_s, r_target, v_target, rtn)
