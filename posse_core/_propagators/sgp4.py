"""Propagator ``sgp4``: target and chaser by SGP4, converted to GCRF axes."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.start import Start
from posse_core._dynamics.tle import Tle
from posse_core._errors import InputError
from posse_core._frames import rtn_from_eci
from posse_core._interfaces.propagator import Flight, FlightPropagator, PropagationProblem


class Sgp4Propagator(FlightPropagator):
    """Propagates both spacecraft by SGP4.

    The chaser has the target's drag, and mean elements that reproduce its state at the epoch. The
    rounding of SGP4 and its old constants leave errors of some mm in the relative state.
    """

    turns_plane = True

    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        if problem.tle is None:
            raise InputError("propagator sgp4 starts from orbit.tle; give it, or use propagator roe")
        tle, start_s = Tle(problem.tle), start.target.t_s
        r_chaser = start.target.r_eci_m + start.dr_eci_m
        v_chaser = start.target.v_eci_m_s + start.dv_eci_m_s
        chaser = tle.neighbour(r_chaser, v_chaser, start_s)
        r, v = tle.state(start_s + after_s)
        turn = start.target.plane_turn_rad_s(r, v)
        rtn = np.concatenate(rtn_from_eci(r, v, *chaser.state(start_s + after_s), turn), axis=-1)
        return Flight(r, v, rtn)
