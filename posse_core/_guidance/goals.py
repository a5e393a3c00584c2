"""The waypoints as wanted states: the instants at which they count, and how exactly they can be met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._guidance.impulse import SAME_INSTANT_S
from posse_core._guidance.motion import RelativeMotion
from posse_core._interfaces.controller import ControlProblem, Waypoint

_DENSE, _SPREAD = 5, 8
_SAMPLES = 9


@dataclass(frozen=True)
class Goals:
    """K wanted states, in order of time.

    Attributes:
        t_s: (K,) instants.
        rtn: (K, 6) wanted states; the velocity is that after an impulse at the same instant.
        waypoint: (K,) number of the waypoint.
    """

    t_s: FloatArray
    rtn: FloatArray
    waypoint: IntArray

    def chosen(self, which: BoolArray | IntArray) -> Goals:
        """Those that an index or a mask selects."""
        return Goals(self.t_s[which], self.rtn[which], self.waypoint[which])

    def after(self, t_s: float) -> Goals:
        """Those at an instant or later."""
        return self.chosen(self.t_s > t_s - SAME_INSTANT_S)

    def thinned(self) -> Goals:
        """The first ones, the first and last of each waypoint, and some between them, ever sparser."""
        count = len(self.t_s)
        edge = np.flatnonzero(np.diff(self.waypoint, prepend=-1, append=-1))
        kept = np.concatenate([np.arange(_DENSE), edge, edge - 1])
        if count > _DENSE:
            kept = np.concatenate([kept, np.geomspace(_DENSE, count, _SPREAD).astype(np.int64)])
        kept = np.unique(kept)
        return self.chosen(kept[(kept >= 0) & (kept < count)])


def goals_of(problem: ControlProblem) -> Goals:
    """All wanted states of a flight.

    A waypoint counts at its own instant and, while it is held, at each instant of an impulse and at the
    end.
    """
    instants = [_instants(waypoint, problem.burns_s) for waypoint in problem.waypoints]
    which = np.repeat(np.arange(len(instants)), [len(t_s) for t_s in instants])
    states = np.array([_state(waypoint) for waypoint in problem.waypoints])
    return Goals(np.concatenate(instants), states[which], which)


def half_widths(problem: ControlProblem, tolerance_m: float, tolerance_m_s: float) -> FloatArray:
    """(W, 6) how far each component of a state may be from each waypoint.

    The box is within the sphere of the tolerance. While a waypoint is held by one impulse in each
    interval, the velocity swings between them by what the attraction changes it; where half of that is
    more than the tolerance, it is the half width.
    """
    tolerance = np.repeat([tolerance_m, tolerance_m_s], 3) / np.sqrt(3)
    widths = np.tile(tolerance, (len(problem.waypoints), 1))
    for width, waypoint in zip(widths, problem.waypoints, strict=True):
        instants = _instants(waypoint, problem.burns_s)
        for t_s, next_s in _some_intervals(instants):
            half = RelativeMotion(problem.target, t_s).transition(np.array([(t_s + next_s) / 2]))[0]
            swing = np.abs(half @ _state(waypoint) - _state(waypoint))
            width[3:] = np.maximum(width[3:], swing[3:])
    return widths


def _some_intervals(instants: FloatArray) -> list[tuple[float, float]]:
    starts = np.unique(np.linspace(0, max(len(instants) - 2, 0), _SAMPLES).astype(np.int64))
    return [(float(instants[k]), float(instants[k + 1])) for k in starts if k + 1 < len(instants)]


def _instants(waypoint: Waypoint, burns_s: FloatArray) -> FloatArray:
    if waypoint.until_s - waypoint.t_s <= SAME_INSTANT_S:
        return np.array([waypoint.t_s])
    inner = (burns_s > waypoint.t_s + SAME_INSTANT_S) & (burns_s < waypoint.until_s - SAME_INSTANT_S)
    return np.concatenate([[waypoint.t_s], burns_s[inner], [waypoint.until_s]])


def _state(waypoint: Waypoint) -> FloatArray:
    return np.concatenate([waypoint.r_rtn_m, waypoint.v_rtn_m_s])
