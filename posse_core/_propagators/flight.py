"""What the core's propagators share: relative orbits by name, and manoeuvres.

A model knows how to fly from one start to a list of times. Here the scenario's keys become starts,
impulses cut a flight into pieces, and several relative orbits are laid end to end.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._dynamics.design import forced_rtn, hop_rtn, natural_roe_m
from posse_core._dynamics.elements import keplerian_from_state
from posse_core._dynamics.orbit import target_state
from posse_core._dynamics.plan import Burn, Transfer, transfer
from posse_core._dynamics.start import Start, Target
from posse_core._errors import InputError
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._plugins.component import OptionsT
from posse_core._scenario.design import VBarHop


@dataclass(frozen=True)
class Flight:
    """Motion over some times: (F, 3) target in GCRF axes (m, m/s), (F, 6) chaser's RTN state."""

    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    rtn: FloatArray


class FlightPropagator(Propagator[OptionsT]):
    """A model that flies from a start; see :meth:`fly`."""

    elliptic: ClassVar[bool] = True
    """The model has no hyperbolic orbits."""

    @abstractmethod
    def fly(
        self, problem: PropagationProblem, start: Start, start_s: float, after_s: FloatArray
    ) -> Flight:
        """The motion at ``after_s`` (F,) seconds after a start that is ``start_s`` after the epoch."""

    def fly_together(
        self, problem: PropagationProblem, starts: list[Start], t_s: FloatArray
    ) -> list[Flight]:
        """The motions from several starts at the epoch beside one target, at ``t_s`` (F,) seconds."""
        return [self.fly(problem, start, 0.0, t_s) for start in starts]

    def propagate(self, problem: PropagationProblem) -> Motion:
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        starts, forced = starts_of(problem, elliptic=self.elliptic), None
        if problem.relative.design is not None:
            forced = forced_rtn(problem.relative.design, t_s)
        if forced is not None:
            flight = self.fly(problem, starts[0], 0.0, t_s)
            rtn, sequence = forced
            return _motion(t_s, [Flight(flight.r_target_eci_m, flight.v_target_eci_m_s, rtn)], sequence)
        if problem.relative.plan is not None:
            flights = [self._fly_plan(problem, start, t_s) for start in starts]
        else:
            flights = self.fly_together(problem, starts, t_s)
        return _motion(t_s, flights, np.repeat(np.arange(len(flights)), len(t_s)))

    def _fly_plan(self, problem: PropagationProblem, start: Start, t_s: FloatArray) -> Flight:
        """Fly from impulse to impulse."""
        out = Flight(np.empty((len(t_s), 3)), np.empty((len(t_s), 3)), np.empty((len(t_s), 6)))
        start_s = -np.inf
        begun_s = 0.0
        for burn in [*planned(problem, start).burns, None]:
            end_s = burn.t_s if burn is not None else np.inf
            chosen = (t_s >= start_s) & (t_s < end_s)
            ask = t_s[chosen] if burn is None else np.append(t_s[chosen], burn.t_s)
            flight = self.fly(problem, start, begun_s, ask - begun_s)
            count = int(np.count_nonzero(chosen))
            out.r_target_eci_m[chosen] = flight.r_target_eci_m[:count]
            out.v_target_eci_m_s[chosen] = flight.v_target_eci_m_s[:count]
            out.rtn[chosen] = flight.rtn[:count]
            if burn is None:
                return out
            start_s = begun_s = burn.t_s
            rtn = flight.rtn[-1].copy()
            rtn[3:] += burn.dv_rtn_m_s
            target = Target(flight.r_target_eci_m[-1], flight.v_target_eci_m_s[-1], problem.constants)
            start = Start(
                target,
                f"relative.plan, after the impulse at {burn.t_s:g} s",
                elliptic=self.elliptic,
                rtn=rtn,
            )
        raise AssertionError("the last piece has no impulse")


def starts_of(problem: PropagationProblem, *, elliptic: bool = True) -> list[Start]:
    """Target and chaser at the epoch, once for each relative orbit of the scenario.

    For a forced design the chaser is at the target.

    Raises:
        InputError: see :func:`posse_core._dynamics.orbit.target_state` and :class:`Start`; or a plan
            beside a design that is not one natural orbit.
    """
    given, constants = problem.relative, problem.constants
    where = "relative." + next(key for key, value in given if value is not None and key != "plan")
    by_state = given.state_rtn is not None or given.state_eci is not None
    r, v = target_state(problem.orbit, constants, elliptic=elliptic or not by_state)

    target = Target(r, v, constants)

    def start(**chaser: FloatArray) -> Start:
        return Start(target, where, elliptic=elliptic, **chaser)

    if given.state_rtn is not None:
        return [start(rtn=np.array([*given.state_rtn.r_m, *given.state_rtn.v_m_s]))]
    if given.state_eci is not None:
        state = np.array([*given.state_eci.r_m, *given.state_eci.v_m_s])
        return [start(apart_eci=state - np.concatenate([r, v]))]
    if given.roe_m is not None:
        return [start(roe_m=np.array(given.roe_m))]
    if given.roe_equinoctial_m is not None:
        return [start(roe_equinoctial_m=np.array(given.roe_equinoctial_m))]
    assert given.design is not None  # the model has exactly one of the keys
    if isinstance(given.design, VBarHop):
        a_m = float(keplerian_from_state(r, v, constants.mu_earth_m3_s2)[0])
        period_s = 2 * np.pi * np.sqrt(a_m**3 / constants.mu_earth_m3_s2)
        return [start(rtn=hop_rtn(given.design, float(period_s)))]
    rows = natural_roe_m(given.design)
    if given.plan is not None and (rows is None or len(rows) > 1):
        raise InputError(
            f"relative.plan: design {given.design.name} is not one natural orbit, so there is nothing"
            " to manoeuvre from"
        )
    return [start(rtn=np.zeros(6))] if rows is None else [start(roe_m=row) for row in rows]


def planned(problem: PropagationProblem, start: Start) -> Transfer:
    """The impulses of a scenario that has a plan.

    Raises:
        InputError: a transfer that its window is too short for, or at an inclination of 0° or 180°.
    """
    plan = problem.relative.plan
    assert plan is not None  # who has none is not asked
    if plan.burns is not None:
        burns = [Burn(burn.t_s, np.array(burn.dv_rtn_m_s)) for burn in plan.burns]
        return Transfer(tuple(sorted(burns, key=lambda burn: burn.t_s)), 0.0)
    wanted = plan.transfer
    assert wanted is not None  # the model has exactly one of the two
    if wanted.end_s <= wanted.start_s:
        raise InputError("relative.plan.transfer: end_s is not after start_s")
    to_roe = np.array(wanted.to_roe_m) / start.target.qns[0]
    window_s = (wanted.start_s, wanted.end_s)
    return transfer(start.target.qns, start.roe, to_roe, window_s, start.target.mu_m3_s2)


def _motion(t_s: FloatArray, flights: list[Flight], sequence: IntArray) -> Motion:
    rtn = np.concatenate([flight.rtn for flight in flights])
    return Motion(
        t_s=np.tile(t_s, len(flights)),
        r_target_eci_m=np.concatenate([flight.r_target_eci_m for flight in flights]),
        v_target_eci_m_s=np.concatenate([flight.v_target_eci_m_s for flight in flights]),
        r_chaser_rtn_m=rtn[:, :3],
        v_chaser_rtn_m_s=rtn[:, 3:],
        sequence=sequence,
    )
