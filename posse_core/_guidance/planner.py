"""The plan of least impulses under boxes about goals and the safety rules."""

from __future__ import annotations

from posse_core._arrays import FloatArray
from posse_core._guidance.horizon import Horizon
from posse_core._guidance.programme import Rows, Solution, least_impulses
from posse_core._guidance.walls import Walls
from posse_core._interfaces.controller import ControlProblem

_FIRST_ROUNDS, _ROUNDS = 10, 1
_SETTLED = 1e-3


class Planner:
    """Makes plans for one flight.

    Args:
        problem: for the limit of impulses and the safety rules.
        margin_sigma: standard deviations of the predicted position that are kept from each wall.
        least_m_s: smaller impulses are not made.
        accuracy: how far the value of a plan may be above the optimum of its convex programme, relative.
    """

    def __init__(
        self,
        problem: ControlProblem,
        margin_sigma: float = 0.0,
        least_m_s: float = 0.0,
        accuracy: float = 1e-2,
    ) -> None:
        self._largest_m_s, self._accuracy = problem.largest_m_s, accuracy
        self._walls = Walls(problem, margin_sigma, least_m_s)

    def plan(
        self, horizon: Horizon, boxes: Rows, covariance: FloatArray, guess: Solution | None
    ) -> Solution | None:
        """The plan, refined about its own path; None if the solver failed or no impulse is left.

        Args:
            horizon: the motion.
            boxes: the goals.
            covariance: (6, 6) of the state's error, m and m/s.
            guess: a plan for nearly the same problem, with the same instants.
        """
        if not len(horizon.burns_s):
            return None
        plan = guess or self._solve(horizon, boxes, None)
        rounds = _FIRST_ROUNDS if guess is None else _ROUNDS
        for k in range(rounds):
            if plan is None:
                return None
            walls = self._walls.rows(horizon, plan.dv_m_s, covariance)
            if walls is None and (k > 0 or guess is None):
                return plan
            rows = boxes if walls is None else Rows.joined([boxes, walls])
            before, plan = plan, self._solve(horizon, rows, plan)
            if plan is not None and abs(plan.value_m_s - before.value_m_s) < _SETTLED * plan.value_m_s:
                break
        return plan

    def _solve(self, horizon: Horizon, rows: Rows, guess: Solution | None) -> Solution | None:
        return least_impulses(
            horizon.effects,
            rows,
            largest_m_s=self._largest_m_s,
            accuracy=self._accuracy,
            guess=guess,
        )
