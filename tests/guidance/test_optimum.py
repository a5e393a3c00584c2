"""The least sum of impulses against other solvers, other models and closed forms."""

from __future__ import annotations

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from approach import CONSTANTS, E_HALF, NEAR_CIRCULAR, later, problem, propagated, target

from posse_core._dynamics.plan import transfer
from posse_core._dynamics.start import Start
from posse_core._guidance.optimum import HOLD_TOLERANCE_M, HOLD_TOLERANCE_M_S, least_dv_m_s
from posse_core._interfaces.controller import Cone, ControlProblem, Safety, Waypoint

BEHIND = np.array([-2.0, -30.0, 3.0, 0.0, 0.01, 0.0])
ORBITS = pytest.mark.parametrize("orbit", [NEAR_CIRCULAR, E_HALF], ids=["circular", "e0.5"])


def clarabel_m_s(task: ControlProblem, rtn: np.ndarray) -> float:
    """The same problem as a cone programme, its sensitivities by differences of exact propagation."""
    (goal,) = task.waypoints
    counted = task.burns_s[task.burns_s >= goal.t_s - 1e-6]
    wanted = np.concatenate([goal.r_rtn_m, goal.v_rtn_m_s])
    free = propagated(task.target, rtn, counted)
    dv = cp.Variable((len(task.burns_s), 3))
    states: list[cp.Expression] = list(free)
    for k, t_s in enumerate(task.burns_s):
        craft = later(task.target, float(t_s))
        before = propagated(task.target, rtn, np.array([t_s]))[0]
        after = np.flatnonzero(counted >= t_s - 1e-6)
        effect = np.empty((len(after), 6, 3))
        for axis in range(3):
            push = 0.01 * np.eye(6)[3 + axis]
            one, two = (
                propagated(craft, before + sign * push, counted[after] - t_s) for sign in (1, -1)
            )
            effect[:, :, axis] = (one - two) / 0.02
        for row, place in enumerate(after):
            states[place] = states[place] + effect[row] @ dv[k]
    box = np.repeat([HOLD_TOLERANCE_M, HOLD_TOLERANCE_M_S], 3) / np.sqrt(3)
    constraints = [cp.abs(state - wanted) <= box for state in states]
    if np.isfinite(task.largest_m_s):
        constraints.append(cp.norm(dv, axis=1) <= task.largest_m_s)
    programme = cp.Problem(cp.Minimize(cp.sum(cp.norm(dv, axis=1))), constraints)
    programme.solve(solver=cp.CLARABEL)
    return float(programme.value)


@ORBITS
@pytest.mark.parametrize("until_s", [300.0, 360.0], ids=["reach", "hold"])
def test_it_is_the_optimum_of_the_cone_programme(orbit, until_s) -> None:
    goal = Waypoint(300.0, until_s, np.array([1.0, -5.0, 0.0]), np.zeros(3))
    task = replace(problem(orbit, until_s), waypoints=(goal,))
    start = Start.from_rtn(task.target, BEHIND[:3], BEHIND[3:])
    assert least_dv_m_s(task, start) == pytest.approx(clarabel_m_s(task, BEHIND), rel=1e-3)


def test_it_is_the_optimum_where_impulses_are_limited() -> None:
    goal = Waypoint(300.0, 300.0, np.array([1.0, -5.0, 0.0]), np.zeros(3))
    task = replace(problem(NEAR_CIRCULAR, 300.0), waypoints=(goal,))
    start = Start.from_rtn(task.target, BEHIND[:3], BEHIND[3:])
    limited = replace(task, largest_m_s=0.03)
    expected = clarabel_m_s(limited, BEHIND)
    assert expected > 1.02 * least_dv_m_s(task, start)
    assert least_dv_m_s(limited, start) == pytest.approx(expected, rel=1e-3)


def test_it_is_between_the_reachable_sets_bound_and_a_plan_in_closed_form() -> None:
    """A transfer of relative orbits: Chernick and D'Amico's bound, Gaias and D'Amico's impulses."""
    task = problem(NEAR_CIRCULAR, 12000.0, step_s=60.0)
    chief = task.target.qns
    start = Start.from_roe(task.target, np.array([0.0, -100.0, 30.0, 0.0, 0.0, 20.0]))
    to_roe = np.array([0.0, -60.0, 0.0, 50.0, 10.0, 40.0]) / chief[0]
    plan = transfer(chief, start.roe, to_roe, (0.0, 12000.0), CONSTANTS.mu_earth_m3_s2)
    arrived = Start.from_roe(later(task.target, 12000.0), to_roe * chief[0])
    goal = Waypoint(12000.0, 12000.0, arrived.rtn[:3], arrived.rtn[3:])
    least = least_dv_m_s(replace(task, waypoints=(goal,)), start, 0.05, 5e-5)
    # The bound holds to first order in the separation and for impulses at any time.
    assert 0.99 * plan.least_dv_m_s < least < 1.001 * plan.dv_m_s


def test_a_change_of_plane_costs_what_the_closed_form_says() -> None:
    """Δv = n·a·|δi|, one impulse at the node of the relative motion, which is after a quarter orbit."""
    craft = target((7.1e6, 0.0, 1.7, 0.1, 0.0, 0.0))
    n = float(np.sqrt(CONSTANTS.mu_earth_m3_s2 / 7.1e6**3))
    amplitude_m = 80.0
    burns_s = np.pi / 2 / n + 60.0 * np.arange(-20, 21)
    goal = Waypoint(float(burns_s[-1]), float(burns_s[-1]), np.zeros(3), np.zeros(3))
    task = replace(problem(NEAR_CIRCULAR, 0.0), target=craft, burns_s=burns_s, waypoints=(goal,))
    start = Start.from_rtn(craft, np.array([0.0, 0.0, amplitude_m]), np.zeros(3))
    assert least_dv_m_s(task, start, 1e-3, 1e-6) == pytest.approx(n * amplitude_m, rel=1e-3)


def test_a_plan_around_the_ellipsoid_costs_more_and_nothing_to_do_costs_nothing() -> None:
    goal = Waypoint(900.0, 900.0, np.array([0.0, 60.0, 0.0]), np.zeros(3))
    task = replace(problem(NEAR_CIRCULAR, 900.0, 30.0), waypoints=(goal,))
    start = Start.from_rtn(task.target, np.array([0.0, -60.0, 0.0]), np.zeros(3))
    free = least_dv_m_s(task, start)
    around = least_dv_m_s(replace(task, safety=Safety(np.array([40.0, 40.0, 40.0]))), start)
    assert free < around < 2 * free
    cone = Cone(np.array([0.0, 1.0, 0.0]), np.radians(20.0), 100.0)
    beside = Start.from_rtn(task.target, np.array([30.0, 40.0, 0.0]), np.zeros(3))
    assert least_dv_m_s(replace(task, safety=Safety(cone=cone)), beside) > least_dv_m_s(task, beside)
    assert least_dv_m_s(replace(task, waypoints=()), start) == 0
