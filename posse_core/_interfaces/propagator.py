"""Propagators: from where target and chaser are at an epoch to where they are at each time."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._constants import Constants
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Start, Target
from posse_core._environment.time import Epoch
from posse_core._model.trajectory import PLANE_TURN, Motion
from posse_core._plugins.component import Component, OptionsT


@dataclass(frozen=True)
class ForcedMotion:
    """A relative motion that is given instead of flown, for F times. RTN: see ``posse_core._frames``.

    Attributes:
        rtn: (F, 6) the chaser's RTN position (m) and velocity (m/s, in the frame that turns).
        sequence: (F,) int; times of one continuous motion have one number.
    """

    rtn: FloatArray
    sequence: IntArray


@dataclass(frozen=True)
class PropagationProblem:
    """States at an epoch, and the times to propagate them to.

    Attributes:
        epoch: the instant of t_s = 0.
        target: the target at the epoch.
        starts: the chaser at the epoch, once for each relative orbit, all beside ``target``; at the
            target where the motion is forced; empty for a propagator that needs none
            (:attr:`Propagator.needs_starts`).
        t_s: (F,) seconds since the epoch.
        burns: impulses, in order of time, for each of the relative orbits.
        forced: the relative motion at ``t_s``, where it is given instead of flown.
        tle: the two lines of the element set that the target's state comes from, if it does.
        requested: whether the frames must be at ``t_s``. If not, a propagator with the capability
            ``own-frames`` gives its own.
        recorded_rate_hz: if given, frames per second over all of a recorded motion, instead of ``t_s``.

    Raises:
        ValueError: a start is beside another target, or the impulses are not in order.
    """

    epoch: Epoch
    target: Target
    starts: tuple[Start, ...]
    t_s: FloatArray
    burns: tuple[Burn, ...] = ()
    forced: ForcedMotion | None = None
    tle: tuple[str, str] | None = None
    requested: bool = False
    recorded_rate_hz: float | None = None

    def __post_init__(self) -> None:
        if any(start.target is not self.target for start in self.starts):
            raise ValueError("every start of a problem is beside the problem's own target")
        instants = [burn.t_s for burn in self.burns]
        if instants != sorted(instants):
            raise ValueError("the impulses of a problem are in order of time")

    @property
    def constants(self) -> Constants:
        """Gravity and radii."""
        return self.target.constants


@dataclass(frozen=True)
class FirstState:
    """The target at the beginning of a recorded motion.

    Attributes:
        epoch: of the state.
        r_eci_m, v_eci_m_s: (3,) position and velocity in GCRF axes.
    """

    epoch: Epoch
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray


class Propagator(Component[OptionsT]):
    """Computes the motion of target and chaser."""

    turns_plane: bool = False
    """Whether this model turns the target's orbital plane by J2. The axes of velocities in RTN then turn
    with it, in the motion and in what the scenario gives: ``Target.plane_turn_rad_s`` is the rate, and
    the motion's extra of that name."""
    needs_starts: ClassVar[bool] = True
    """False for a motion that was made elsewhere: the problem then has no starts, and the orbit and
    the relative motion of the scenario need not be such as can be flown."""

    def first_state(self) -> FirstState | None:
        """The beginning of a motion that was made elsewhere, for scenarios without ``orbit``.

        Raises:
            posse_core.InputError: the motion cannot be read, or its epoch is not known.
        """
        return None

    @abstractmethod
    def propagate(self, problem: PropagationProblem) -> Motion:
        """The motion at ``problem.t_s``, for each of the starts one after the other.

        A propagator without manoeuvres or forced motion refuses a problem that has them.

        Raises:
            posse_core.InputError: the problem is outside this model's domain; the message says which
                model to take.
        """


@dataclass(frozen=True)
class Flight:
    """Motion over F times.

    Attributes:
        r_target_eci_m, v_target_eci_m_s: (F, 3) GCRF axes, geocentric.
        rtn: (F, 6) the chaser's RTN position (m) and velocity (m/s, in the frame that turns).
    """

    r_target_eci_m: FloatArray
    v_target_eci_m_s: FloatArray
    rtn: FloatArray


class FlightPropagator(Propagator[OptionsT]):
    """A model that flies from one start to a list of times; see :meth:`fly`.

    Impulses, forced motions and several relative orbits are handled here: a flight with impulses is
    flown from one to the next, and several relative orbits are laid end to end.
    """

    elliptic: ClassVar[bool] = True
    """The model has elliptic orbits alone; others are refused before it flies."""

    @abstractmethod
    def fly(self, problem: PropagationProblem, start: Start, after_s: FloatArray) -> Flight:
        """The motion at (F,) seconds after a start.

        Args:
            problem: for its epoch, constants and element set.
            start: at the epoch, or just after an impulse, ``start.target.t_s`` seconds later.
            after_s: (F,) seconds after the start, in any order; negative before it.

        Raises:
            posse_core.InputError: the start is outside this model's domain.
        """

    def fly_together(
        self, problem: PropagationProblem, starts: Sequence[Start], t_s: FloatArray
    ) -> list[Flight]:
        """The motions from several starts at the epoch, at (F,) seconds after it.

        A model that is faster for all of them at once overrides this.
        """
        return [self.fly(problem, start, t_s) for start in starts]

    def propagate(self, problem: PropagationProblem) -> Motion:
        if self.elliptic:
            problem.target.check(elliptic=True)
            for start in problem.starts:
                start.check(elliptic=True)
        t_s = np.asarray(problem.t_s, dtype=np.float64)
        if problem.forced is not None:
            flight = self.fly(problem, problem.starts[0], t_s)
            beside = Flight(flight.r_target_eci_m, flight.v_target_eci_m_s, problem.forced.rtn)
            return _motion(t_s, [beside], problem.forced.sequence, problem.target)
        if problem.burns:
            flights = [self._fly_burns(problem, start, t_s) for start in problem.starts]
        else:
            flights = self.fly_together(problem, problem.starts, t_s)
        return _motion(t_s, flights, np.repeat(np.arange(len(flights)), len(t_s)), problem.target)

    def _fly_burns(self, problem: PropagationProblem, start: Start, t_s: FloatArray) -> Flight:
        """Fly from impulse to impulse."""
        out = Flight(np.empty((len(t_s), 3)), np.empty((len(t_s), 3)), np.empty((len(t_s), 6)))
        start_s = -np.inf
        for burn in [*problem.burns, None]:
            end_s = burn.t_s if burn is not None else np.inf
            chosen = (t_s >= start_s) & (t_s < end_s)
            ask = t_s[chosen] if burn is None else np.append(t_s[chosen], burn.t_s)
            flight = self.fly(problem, start, ask - start.target.t_s)
            count = int(np.count_nonzero(chosen))
            out.r_target_eci_m[chosen] = flight.r_target_eci_m[:count]
            out.v_target_eci_m_s[chosen] = flight.v_target_eci_m_s[:count]
            out.rtn[chosen] = flight.rtn[:count]
            if burn is None:
                break
            start_s = burn.t_s
            target = Target(
                flight.r_target_eci_m[-1],
                flight.v_target_eci_m_s[-1],
                problem.constants,
                t_s=burn.t_s,
                where=f"the target at {burn.t_s:g} s",
                turns_plane=start.target.turns_plane,
            )
            start = Start.from_rtn(
                target,
                flight.rtn[-1, :3],
                flight.rtn[-1, 3:] + burn.dv_rtn_m_s,
                where=f"relative.plan, after the impulse at {burn.t_s:g} s",
            )
            if self.elliptic:
                start.check(elliptic=True)
        return out


def _motion(t_s: FloatArray, flights: list[Flight], sequence: IntArray, target: Target) -> Motion:
    rtn = np.concatenate([flight.rtn for flight in flights])
    r_target_eci_m = np.concatenate([flight.r_target_eci_m for flight in flights])
    v_target_eci_m_s = np.concatenate([flight.v_target_eci_m_s for flight in flights])
    extras = {}
    if target.turns_plane:
        extras[PLANE_TURN] = target.plane_turn_rad_s(r_target_eci_m, v_target_eci_m_s)
    return Motion(
        t_s=np.tile(t_s, len(flights)),
        r_target_eci_m=r_target_eci_m,
        v_target_eci_m_s=v_target_eci_m_s,
        r_chaser_rtn_m=rtn[:, :3],
        v_chaser_rtn_m_s=rtn[:, 3:],
        sequence=sequence,
        extras=extras,
    )
