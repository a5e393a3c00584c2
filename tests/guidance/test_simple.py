"""Controllers ``plan``, ``hold`` and ``lqr``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from approach import E_HALF, NEAR_CIRCULAR, estimate, fly, problem
from scipy.linalg import solve_discrete_are

from posse_core._dynamics.linear import hcw_stm
from posse_core._dynamics.plan import Burn
from posse_core._errors import InputError
from posse_core._guidance.hold import HoldController
from posse_core._guidance.lqr import LqrController
from posse_core._guidance.options import HoldOptions, LqrOptions
from posse_core._guidance.plan import PlanController
from posse_core._interfaces.controller import Waypoint
from posse_core._interfaces.navigator import ThrusterErrors
from posse_core._plugins.options import NoOptions

BEHIND = np.array([0.0, -30.0, 0.0, 0.0, 0.0, 0.0])


def test_each_impulse_of_a_plan_is_commanded_at_the_nearest_instant() -> None:
    plan = (
        Burn(4.0, np.array([1.0, 0.0, 0.0])),
        Burn(12.0, np.array([0.0, 2.0, 0.0])),
        Burn(13.0, np.array([0.0, 0.0, 3.0])),
        Burn(500.0, np.array([0.0, 0.0, 4.0])),
    )
    controller = PlanController(NoOptions())
    controller.start(replace(problem(NEAR_CIRCULAR, 40.0), plan=plan))
    commands = [controller.command(estimate(BEHIND, t_s)) for t_s in np.arange(0.0, 41.0, 10.0)]
    np.testing.assert_array_equal(commands, [[1, 0, 0], [0, 2, 3], [0, 0, 0], [0, 0, 0], [0, 0, 4]])


def test_a_plan_without_an_instant_for_it_is_refused() -> None:
    plan = (Burn(4.0, np.ones(3)),)
    with pytest.raises(InputError, match="no instant at which an impulse is possible"):
        PlanController(NoOptions()).start(
            replace(problem(NEAR_CIRCULAR, 40.0), plan=plan, burns_s=np.empty(0))
        )


def test_impulses_are_no_larger_than_the_limit_and_none_below_the_least() -> None:
    plan = (Burn(0.0, np.array([0.3, 0.0, 0.4])), Burn(10.0, np.array([0.0, 0.0, 1e-3])))
    controller = PlanController(NoOptions())
    limits = replace(
        problem(NEAR_CIRCULAR, 40.0),
        plan=plan,
        largest_m_s=0.25,
        thrusters=ThrusterErrors(least_m_s=2e-3),
    )
    controller.start(limits)
    np.testing.assert_allclose(controller.command(estimate(BEHIND, 0.0)), [0.15, 0, 0.2], rtol=1e-15)
    np.testing.assert_array_equal(controller.command(estimate(BEHIND, 10.0)), np.zeros(3))


@pytest.mark.parametrize("orbit", [NEAR_CIRCULAR, E_HALF], ids=["circular", "e0.5"])
@pytest.mark.parametrize("goal", [None, [3.0, -28.0, 1.0]])
def test_hold_stays(orbit, goal) -> None:
    """At 10 m above V-bar the attraction alone would move the chaser by tens of metres."""
    waypoints = () if goal is None else (Waypoint(0.0, 0.0, np.array(goal), np.zeros(3)),)
    task = replace(problem(orbit, 1200.0), waypoints=waypoints)
    start = np.array([10.0, -30.0, 5.0, 0.0, 0.0, 0.0]) if goal is None else BEHIND
    flight = fly(HoldController(HoldOptions()), task, start)
    kept = start[:3] if goal is None else np.array(goal)
    late = flight.states[60:, :3]
    assert np.abs(late - kept).max() < 0.08
    assert np.count_nonzero(flight.dv.any(axis=1)) < 80  # a deadband: not at every instant


def test_lqr_gain_is_that_of_the_riccati_equation_in_a_long_hold() -> None:
    task = problem(NEAR_CIRCULAR, 8000.0)
    task = replace(task, waypoints=(Waypoint(0.0, 8000.0, np.array([0.0, -5.0, 0.0]), np.zeros(3)),))
    options = LqrOptions(position_m=0.3, velocity_m_s=0.01, impulse_m_s=0.02)
    controller = LqrController(options)
    controller.start(task)
    chief = task.target.qns.copy()
    chief[2:4] = 0
    A = hcw_stm(chief, task.target.mu_m3_s2, 10.0)
    B = np.vstack([np.zeros((3, 3)), np.eye(3)])
    # The cost counts the state after the impulse x + Bu; with that state as y: y' = Ay + Bu'.
    weight = np.diag(np.repeat([0.3**-2.0, 0.01**-2.0], 3))
    P = solve_discrete_are(A, A @ B, weight, np.eye(3) * 0.02**-2.0 + B.T @ weight @ B, s=weight @ B)
    H = np.eye(3) * 0.02**-2.0 + B.T @ weight @ B + (A @ B).T @ P @ (A @ B)
    gain = np.linalg.solve(H, (A @ B).T @ P @ A + B.T @ weight)
    np.testing.assert_allclose(controller.gains[10], gain, rtol=2e-3, atol=2e-5)


@pytest.mark.parametrize("orbit", [NEAR_CIRCULAR, E_HALF], ids=["circular", "e0.5"])
def test_lqr_reaches_and_holds(orbit) -> None:
    goals = (
        Waypoint(300.0, 300.0, np.array([2.0, -15.0, 1.0]), np.array([0.0, 0.01, 0.0])),
        Waypoint(600.0, 900.0, np.array([0.0, -5.0, 0.0]), np.zeros(3)),
    )
    task = replace(problem(orbit, 900.0), waypoints=goals)
    flight = fly(LqrController(LqrOptions()), task, BEHIND)
    at = flight.states[30]
    np.testing.assert_allclose(at[:3], goals[0].r_rtn_m, atol=0.05)
    np.testing.assert_allclose(at[3:], goals[0].v_rtn_m_s, atol=2e-3)
    np.testing.assert_allclose(flight.states[60:, :3], np.tile(goals[1].r_rtn_m, (31, 1)), atol=0.05)


def test_lqr_needs_a_waypoint() -> None:
    with pytest.raises(InputError, match="controller lqr needs a waypoint; add one"):
        LqrController(LqrOptions()).start(problem(NEAR_CIRCULAR, 100.0))
