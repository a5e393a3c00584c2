"""The least sum of impulse sizes under linear constraints on the motion: a linear programme.

An impulse is a sum of non-negative multiples of unit vectors, and its size is at most their sum. With
all unit vectors this is the second-order cone programme itself. A few are enough if they are the right
ones, and the dual solution names them (column generation): it gives Lawden's primer vector p at each
instant, and a unit vector along p makes the sum smaller exactly where |p| > 1. The largest |p| also
bounds how far the sum is above the optimum, so that the programme is solved to a known accuracy.
(Lawden, Optimal Trajectories for Space Navigation, 1963; Koenig and D'Amico, IEEE Trans. Autom. Control
66, 2021, 1605.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray

_AXES = np.vstack([np.eye(3), -np.eye(3)])
_SPARSE = 5
"""With a guess, the axes are columns at every fifth instant only."""
_ROUNDS = 12
_NEGLIGIBLE_M_S = 1e-7
_TINY = 1e-12
_UNIT_M_S = 1e-3
"""Unit of the programme's impulses, in which its numbers are of order one."""
_LEAST_ENTRY = 1e-7
"""Smaller entries are left out; all are scaled to at most one."""


@dataclass(frozen=True)
class Rows:
    """M constraints ``low ≤ g · z ≤ high``, where z is the sum of the impulses' effects.

    Attributes:
        last: (M,) number of the last impulse that z includes.
        g: (M, 6).
        low, high: (M,), infinite where there is no bound.
        penalty: (M,) cost of a violation by one unit, so that there is always a solution.
    """

    last: IntArray
    g: FloatArray
    low: FloatArray
    high: FloatArray
    penalty: FloatArray

    @staticmethod
    def joined(parts: list[Rows]) -> Rows:
        """All constraints of several."""
        return Rows(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("last", "g", "low", "high", "penalty")
            )
        )

    def chosen(self, which: Any) -> Rows:
        """Those that an index or a mask selects."""
        return Rows(
            self.last[which], self.g[which], self.low[which], self.high[which], self.penalty[which]
        )


@dataclass(frozen=True)
class Solution:
    """Impulses of least sum.

    Attributes:
        dv_m_s: (N, 3).
        primer: (N, 3) primer vectors; longest where an impulse is worth most.
        value_m_s: sum of the sizes, and the penalties.
        bound_m_s: lower bound of the optimum of ``value_m_s``.
    """

    dv_m_s: FloatArray
    primer: FloatArray
    value_m_s: float
    bound_m_s: float

    def after(self, passed: int) -> Solution:
        """The same without the first impulses."""
        return Solution(self.dv_m_s[passed:], self.primer[passed:], self.value_m_s, self.bound_m_s)


def least_impulses(
    effects: FloatArray,
    rows: Rows,
    *,
    largest_m_s: float = np.inf,
    accuracy: float = 1e-2,
    guess: Solution | None = None,
) -> Solution | None:
    """Solve the programme; None if the solver failed.

    Args:
        effects: (N, 6, 3) of each impulse on z, in order of time.
        rows: the constraints.
        largest_m_s: limit of the size of each impulse.
        accuracy: how far the value may be above the bound, relative.
        guess: the solution of a similar programme with the same instants.
    """
    count = len(effects)
    if not len(rows.last):
        return Solution(np.zeros((count, 3)), np.zeros((count, 3)), 0.0, 0.0)
    instants = np.arange(0, count, 1 if guess is None else _SPARSE)
    at: IntArray = np.repeat(instants, len(_AXES))
    columns = at, np.tile(_AXES, (len(instants), 1))
    if guess is not None:
        columns = _with_directions(*columns, guess.primer, 1 - 1e-1)
        columns = _with_directions(*columns, guess.dv_m_s, _NEGLIGIBLE_M_S)
    solution, bound = None, 0.0
    for _ in range(_ROUNDS):
        solved = _solve(effects, *columns, rows, largest_m_s)
        if solved is None:
            break
        dv, primer, cost, penalties, limit_duals = solved
        value = penalties + float(np.linalg.norm(dv, axis=1).sum())
        lengths = np.linalg.norm(primer, axis=1)
        bound = max(bound, cost / float(np.max(lengths - limit_duals, initial=1.0)))
        solution = Solution(dv, primer, value, bound)
        if value <= bound * (1 + accuracy):
            break
        columns = _with_directions(*columns, primer, 1 + accuracy / 2)
        columns = _with_directions(*columns, dv, _NEGLIGIBLE_M_S)
    return solution


def _with_directions(
    at: IntArray, along: FloatArray, vectors: FloatArray, above: float
) -> tuple[IntArray, FloatArray]:
    """Columns and the unit vectors of those of (N, 3) vectors that are longer than ``above``."""
    lengths = np.linalg.norm(vectors, axis=1)
    new = np.flatnonzero(lengths > above)
    return np.concatenate([at, new]), np.vstack([along, vectors[new] / lengths[new, None]])


def _solve(
    effects: FloatArray, at: IntArray, along: FloatArray, rows: Rows, largest_m_s: float
) -> tuple[FloatArray, FloatArray, float, float, FloatArray] | None:
    """Solve with the columns ``along`` (C, 3) at the instants ``at`` (C,).

    The unknowns are the columns' amounts, z after those impulses that a constraint names, the values of
    the constraints, their violations, and what is left of each limit. Each is divided by a scale.

    Returns:
        The impulses (N, 3), the primer vectors (N, 3), the cost, the penalties in it, and the duals (N,)
        of the limits.
    """
    # Half a second to import, and most programs plan no flight.
    from scipy.optimize import linprog
    from scipy.sparse import coo_array

    count = len(effects)
    columns = np.einsum("cij,cj->ci", effects[at], along)
    named = np.unique(rows.last)
    stage = np.searchsorted(named, at)  # the first named z that includes the impulse
    live = np.flatnonzero(stage < len(named))
    scale = np.max(np.abs(columns), axis=0) + _TINY
    size = np.max(np.abs(rows.g * scale), axis=1) + _TINY
    below, above = (np.flatnonzero(np.isfinite(bound)) for bound in (rows.low, rows.high))
    limits = count if np.isfinite(largest_m_s) else 0
    C, S, M, B, A = len(at), 6 * len(named), len(rows.last), len(below), len(above)
    at_z, at_value, at_below, at_above, at_left = np.cumsum([C, S, M, B, A])
    six, one = np.arange(6), np.ones
    entries: list[tuple[AnyArray, AnyArray, AnyArray]] = [
        # z after a stage = z after the stage before + the effects between
        (6 * stage[live][:, None] + six, np.repeat(live[:, None], 6, 1), columns[live] / scale),
        (np.arange(S), at_z + np.arange(S), -one(S)),
        (np.arange(6, S), at_z + np.arange(S - 6), one(max(S - 6, 0))),
        # value of a constraint = g · z + violation below − violation above
        (
            np.repeat(S + np.arange(M)[:, None], 6, 1),
            at_z + 6 * np.searchsorted(named, rows.last)[:, None] + six,
            rows.g * scale / size[:, None],
        ),
        (S + np.arange(M), at_value + np.arange(M), -one(M)),
        (S + below, at_below + np.arange(B), one(B)),
        (S + above, at_above + np.arange(A), -one(A)),
    ]
    if limits:
        entries.append((S + M + at, np.arange(C), one(C)))
        entries.append((S + M + np.arange(limits), at_left + np.arange(limits), one(limits)))
    i, j, values = (np.concatenate([np.ravel(entry[k]) for entry in entries]) for k in range(3))
    kept = np.abs(values) > _LEAST_ENTRY
    matrix = coo_array(
        (values[kept], (i[kept], j[kept])), shape=(S + M + limits, at_left + limits)
    ).tocsc()
    zero, free = np.zeros, np.full(S, np.inf)
    lower = np.concatenate([zero(C), -free, rows.low / size / _UNIT_M_S, zero(B + A + limits)])
    upper = np.concatenate(
        [np.full(C, np.inf), free, rows.high / size / _UNIT_M_S, np.full(B + A + limits, np.inf)]
    )
    penalty = rows.penalty * size
    found = linprog(
        np.concatenate([one(C), zero(S + M), penalty[below], penalty[above], zero(limits)]),
        A_eq=matrix,
        b_eq=np.concatenate([zero(S + M), np.full(limits, largest_m_s / _UNIT_M_S)]),
        bounds=np.column_stack([lower, upper]),
        method="highs-ds",
    )
    if not found.success:
        return None
    amounts, duals = found.x[:C] * _UNIT_M_S, found.eqlin.marginals
    dv = np.zeros((count, 3))
    np.add.at(dv, at, along * amounts[:, None])
    cost = float(found.fun) * _UNIT_M_S
    by_stage = np.vstack([duals[:S].reshape(-1, 6) / scale, np.zeros(6)])
    worth = by_stage[np.searchsorted(named, np.arange(count))]
    limit_duals = np.abs(duals[S + M :]) if limits else np.zeros(count)
    primer = np.einsum("nij,ni->nj", effects, worth)
    return dv, primer, cost, cost - float(amounts.sum()), limit_duals
