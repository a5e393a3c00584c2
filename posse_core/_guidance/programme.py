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

import casadi as ca
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
"""HiGHS refuses programmes with smaller entries; all are scaled to at most one."""


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

    Returns the impulses (N, 3), the primer vectors (N, 3), the cost, the penalties in it, and the duals
    (N,) of the limits.

    The unknowns are the columns' amounts, z after those impulses that a constraint names, each divided
    by a scale, and the violations.
    """
    count = len(effects)
    columns = np.einsum("cij,cj->ci", effects[at], along)
    named = np.unique(rows.last)
    scale = np.max(np.abs(columns), axis=0) + _TINY
    stage = np.searchsorted(named, at)  # the first named z that includes the impulse
    live = np.flatnonzero(stage < len(named))
    C, S, M = len(at), 6 * len(named), len(rows.last)
    low, high = np.isfinite(rows.low), np.isfinite(rows.high)
    size = np.max(np.abs(rows.g * scale), axis=1) + _TINY
    g = rows.g * scale / size[:, None]
    below, above = np.flatnonzero(low), np.flatnonzero(high)
    six, states = np.arange(6), np.arange(S)
    limited = np.isfinite(largest_m_s)
    entries: list[tuple[AnyArray, AnyArray, AnyArray]] = [
        # z after a stage = z after the stage before + the effects between
        (6 * stage[live][:, None] + six, np.repeat(live[:, None], 6, 1), columns[live] / scale),
        (states, C + states, -np.ones(S)),
        (states[6:], C + states[:-6], np.ones(max(S - 6, 0))),
        # the constraints, each with its violations
        (
            np.repeat(S + np.arange(M)[:, None], 6, 1),
            C + 6 * np.searchsorted(named, rows.last)[:, None] + six,
            g,
        ),
        (S + below, C + S + np.arange(len(below)), np.ones(len(below))),
        (S + above, C + S + len(below) + np.arange(len(above)), -np.ones(len(above))),
    ]
    if limited:
        entries.append((S + M + at, np.arange(C), np.ones(C)))
    height, width = S + M + (count if limited else 0), C + S + len(below) + len(above)
    i, j, values = (np.concatenate([np.ravel(entry[k]) for entry in entries]) for k in range(3))
    kept = np.abs(values) > _LEAST_ENTRY
    i, j, values = i[kept], j[kept], values[kept]
    order = np.lexsort((i, j))
    starts = np.concatenate([[0], np.cumsum(np.bincount(j, minlength=width))])
    pattern = ca.Sparsity(height, width, starts.tolist(), i[order].tolist())
    solver = ca.conic(
        "least_impulses",
        "highs",
        {"a": pattern, "h": ca.Sparsity(width, width)},
        {"error_on_fail": False, "highs": {"output_flag": False}},
    )
    found = solver(
        a=ca.DM(pattern, values[order]),
        g=np.concatenate(
            [
                np.ones(C),
                np.zeros(S),
                (rows.penalty * size)[below],
                (rows.penalty * size)[above],
            ]
        ),
        lba=np.concatenate([np.zeros(S), rows.low / size, np.zeros(height - S - M)]) / _UNIT_M_S,
        uba=np.concatenate([np.zeros(S), rows.high / size, np.full(height - S - M, largest_m_s)])
        / _UNIT_M_S,
        lbx=np.concatenate([np.zeros(C), np.full(S, -np.inf), np.zeros(width - C - S)]),
        ubx=np.inf,
    )
    if not solver.stats()["success"]:
        return None
    lam, amounts = np.array(found["lam_a"])[:, 0], np.array(found["x"])[:C, 0] * _UNIT_M_S
    dv = np.zeros((count, 3))
    np.add.at(dv, at, along * amounts[:, None])
    cost = float(found["cost"]) * _UNIT_M_S
    stage_of = np.searchsorted(named, np.arange(count))
    duals = np.vstack([-lam[:S].reshape(-1, 6) / scale, np.zeros(6)])[stage_of]
    limit_duals = np.abs(lam[S + M :]) if limited else np.zeros(count)
    primer = np.einsum("nij,ni->nj", effects, duals)
    return dv, primer, cost, cost - float(amounts.sum()), limit_duals
