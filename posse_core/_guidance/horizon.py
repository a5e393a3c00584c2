"""What lies ahead of an instant: the instants of impulses, and the constraints in their terms."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._guidance.goals import Goals
from posse_core._guidance.impulse import SAME_INSTANT_S
from posse_core._guidance.motion import RelativeMotion
from posse_core._guidance.programme import Rows
from posse_core._interfaces.controller import ControlProblem

POSITION_PENALTY = 2.0
"""Cost of missing a goal by a metre, m/s: what reaches it costs more only within 0.1 s."""
VELOCITY_PENALTY = 20.0
"""Cost of missing a goal's velocity by 1 m/s."""


class Horizon:
    """The motion from a state on, as it is without impulses and as impulses change it.

    Args:
        problem: for the target and the instants of impulses.
        t_s: the instant of the state.
        rtn: (6,) the state, before an impulse at this instant.

    Attributes:
        burns_s: (N,) the instants of impulses from ``t_s`` on.
        effects: (N, 6, 3) of a unit impulse at each, as the change of the state at ``t_s`` that leads to
            the same motion afterwards. Their sum is z in :mod:`posse_core._guidance.programme`.
        passed: the number of instants of impulses before ``t_s``.
    """

    def __init__(self, problem: ControlProblem, t_s: float, rtn: FloatArray) -> None:
        self.t_s, self.rtn = t_s, rtn
        self.passed = int(np.sum(problem.burns_s < t_s - SAME_INSTANT_S))
        self.burns_s = problem.burns_s[self.passed :]
        self.motion = RelativeMotion(problem.target, t_s)
        inverse = np.asarray(np.linalg.inv(self.motion.transition(self.burns_s)))
        self.effects: FloatArray = inverse[:, :, 3:]

    def path(self, dv_m_s: FloatArray, t_s: FloatArray) -> FloatArray:
        """(N, 3) impulses, (K,) → (K, 6): RTN states, after an impulse at the same instant."""
        z = np.cumsum(np.einsum("nij,nj->ni", self.effects, dv_m_s), axis=0)
        z = np.vstack([np.zeros(6), z])[self.last(t_s) + 1]
        free = self.motion.drift(self.rtn, t_s)
        return np.asarray(free + np.einsum("kij,kj->ki", self.motion.transition(t_s), z))

    def last(self, t_s: FloatArray) -> IntArray:
        """(K,) → (K,) the number of the last impulse at or before each instant; −1 if there is none."""
        return np.searchsorted(self.burns_s, t_s + SAME_INSTANT_S) - 1

    def box(self, goals: Goals, half_width: FloatArray) -> Rows:
        """The goals as constraints: each component within (K, 6) half widths of what is wanted.

        The first impulse cannot change where the chaser is at its own instant, so that is left out.
        """
        free = self.motion.drift(self.rtn, goals.t_s)
        middle = (goals.rtn - free).reshape(-1)
        last = np.repeat(self.last(goals.t_s), 6)
        rows = Rows(
            last,
            self.motion.transition(goals.t_s).reshape(-1, 6),
            middle - half_width.reshape(-1),
            middle + half_width.reshape(-1),
            np.tile(np.repeat([POSITION_PENALTY, VELOCITY_PENALTY], 3), len(goals.t_s)),
        )
        position = np.tile(np.arange(6) < 3, len(goals.t_s))
        now = np.repeat(goals.t_s < self.t_s + SAME_INSTANT_S, 6)
        return rows.chosen((last >= 0) & ~(position & now))
