"""Controller ``impulsive-mpc``: plans all impulses ahead at each instant, and commands the first."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._guidance.goals import Goals, goals_of, half_widths
from posse_core._guidance.horizon import Horizon
from posse_core._guidance.impulse import SAME_INSTANT_S, carried_out, check_waypoints
from posse_core._guidance.options import MpcOptions
from posse_core._guidance.planner import Planner
from posse_core._guidance.programme import Solution
from posse_core._guidance.walls import check_safety
from posse_core._interfaces.controller import Controller, ControlProblem
from posse_core._interfaces.navigator import Estimate

_CLOSEST = 0.5
"""The box of a goal is never narrower than this share of the tolerance."""
_AIM = 0.5
"""An impulse aims at this share of the box that made it necessary."""
_RAMP_S = 200.0
"""While a goal is held, the aim narrows over this time, so that a deviation is not undone in haste."""
_RETURN_S = 60.0
"""A chaser outside the box of a goal that is held comes back over this time: in less, it costs more."""


class ImpulsiveMpc(Controller[MpcOptions]):
    """Reaches and holds the waypoints with the least sum of impulse sizes, under the safety rules.

    The estimate's errors decide what is worth an impulse. At each instant, a plan is made for wide boxes
    about the wanted states: wide as the tolerance, less what the present position and velocity may be
    wrong by, but not narrower than ``significance`` standard deviations of the state that is predicted
    for that instant. A deviation within such a box can be the estimate's error, and is better known
    later. Only if this plan begins with an impulse now, a second plan is made for narrower boxes about
    the wanted states, and its first impulse is commanded.
    """

    def start(self, problem: ControlProblem) -> None:
        check_waypoints(problem, "impulsive-mpc")
        check_safety(problem)
        options = self.options
        self._problem = problem
        self._goals = goals_of(problem)
        self._arrival_s = np.array([waypoint.t_s for waypoint in problem.waypoints])
        self._tolerance = half_widths(problem, options.tolerance_m, options.tolerance_m_s)
        self._swing = half_widths(problem, 0.0, 0.0)
        self._least_m_s = max(problem.thrusters.least_m_s, options.deadband_m_s)
        self._planner = Planner(problem, options.margin_sigma, self._least_m_s)
        self._plan: Solution | None = None
        self._passed = 0

    def command(self, estimate: Estimate) -> FloatArray:
        state = np.concatenate([estimate.r_rtn_m, estimate.v_rtn_m_s])
        horizon = Horizon(self._problem, estimate.t_s, state)
        covariance = estimate.covariance[:6, :6]
        goals = self._goals.after(estimate.t_s).thinned()
        wide = self._boxes(horizon, goals, covariance)
        guess = self._plan.after(horizon.passed - self._passed) if self._plan is not None else None
        plan = self._planner.plan(horizon, horizon.box(goals, wide), covariance, guess)
        if plan is not None and self._is_worth_it(plan):
            narrower = 1 - (1 - _AIM) * np.clip((goals.t_s - estimate.t_s) / _RAMP_S, 0, 1)
            boxes = horizon.box(goals, wide * narrower[:, None])
            plan = self._planner.plan(horizon, boxes, covariance, plan)
        plan = plan or guess
        self._plan, self._passed = plan, horizon.passed
        if plan is None or not self._is_worth_it(plan):
            return np.zeros(3)
        return carried_out(plan.dv_m_s[0], self._problem)

    def _is_worth_it(self, plan: Solution) -> bool:
        return bool(np.linalg.norm(plan.dv_m_s[0]) > self._least_m_s)

    def _boxes(self, horizon: Horizon, goals: Goals, covariance: FloatArray) -> FloatArray:
        """(K, 6) half widths about the wanted states."""
        tolerance = self._tolerance[goals.waypoint]
        known = tolerance - np.sqrt(np.diag(covariance))
        phi = horizon.motion.transition(goals.t_s)
        predicted = np.sqrt(np.einsum("kij,jl,kil->ki", phi, covariance, phi))
        inner = np.maximum(np.maximum(known, _CLOSEST * tolerance), self._swing[goals.waypoint])
        wide = np.maximum(inner, self.options.significance * predicted)
        held = self._arrival_s[goals.waypoint] < horizon.t_s + SAME_INSTANT_S
        late = np.clip(1 - (goals.t_s - horizon.t_s) / _RETURN_S, 0, 1)
        away_m = np.abs(horizon.rtn[:3] - goals.rtn[:, :3])
        wide[:, :3] = np.maximum(wide[:, :3], (held * late)[:, None] * away_m)
        return np.asarray(wide)
