"""Controller ``plan``: carries out impulses that were planned beforehand."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._guidance.impulse import SAME_INSTANT_S, carried_out
from posse_core._interfaces.controller import Controller, ControlProblem
from posse_core._interfaces.navigator import Estimate
from posse_core._plugins.options import NoOptions


class PlanController(Controller[NoOptions]):
    """Each impulse of the plan is commanded at the nearest instant at which one is possible.

    Impulses with the same nearest instant are added. The estimate is not used, but for its instant.
    """

    def start(self, problem: ControlProblem) -> None:
        if problem.plan and not len(problem.burns_s):
            raise InputError(
                "controller plan: the flight has no instant at which an impulse is possible"
            )
        self._problem = problem
        self._dv = np.zeros((len(problem.burns_s), 3))
        for burn in problem.plan:
            self._dv[int(np.argmin(np.abs(problem.burns_s - burn.t_s)))] += burn.dv_rtn_m_s

    def command(self, estimate: Estimate) -> FloatArray:
        now = np.abs(self._problem.burns_s - estimate.t_s) < SAME_INSTANT_S
        return carried_out(self._dv[now].sum(axis=0), self._problem)
