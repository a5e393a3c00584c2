"""``truth`` and ``dead-reckoning`` against the closed-form propagator, and the impulses' covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rendezvous import World, errors

from posse_core import Burn, ComponentError, Readings, ThrusterErrors
from posse_core._navigation.coasting import DeadReckoningNavigator, TruthNavigator
from posse_core._navigation.options import DynamicsOptions

BURNS = (Burn(105.0, np.array([0.01, -0.02, 0.005])), Burn(1200.0, np.array([0.0, 0.03, 0.0])))


def exactly_started(world: World, rng: np.random.Generator, **known):
    problem = world.problem(rng, **known)
    (first,) = world.truth(np.zeros(1))
    start = replace(problem.start, r_rtn_m=first.r_rtn_m, v_rtn_m_s=first.v_rtn_m_s)
    return replace(problem, start=start)


@pytest.mark.parametrize("e", [0.0, 0.01, 0.5])
def test_dead_reckoning_follows_the_closed_form_through_impulses(e):
    world = World(e=e, burns=BURNS)
    navigator = DeadReckoningNavigator(DynamicsOptions())
    navigator.start(exactly_started(world, np.random.default_rng(0)))
    for burn in BURNS:
        navigator.burned(burn)
    for state in world.truth(np.array([0.0, 100.0, 1000.0, 4000.0])):
        estimate = navigator.estimate(state.t_s)
        np.testing.assert_allclose(estimate.r_rtn_m, state.r_rtn_m, atol=2e-5)
        np.testing.assert_allclose(estimate.v_rtn_m_s, state.v_rtn_m_s, atol=2e-8)
        assert estimate.covariance.shape == (6, 6)
        assert estimate.q_eci_from_body is None


def test_the_truth_is_propagated_through_a_later_impulse():
    world = World(e=0.3, burns=BURNS, rate_body_rad_s=(0.004, 0.02, -0.001))
    navigator = TruthNavigator(DynamicsOptions())
    navigator.start(world.problem(np.random.default_rng(0)))
    assert navigator.estimate(0.0) is None
    first, last = world.truth(np.array([100.0, 700.0]))
    navigator.burned(BURNS[0])
    navigator.update(Readings(0, 100.0, 110.0, first.q_eci_from_body, truth=first))
    np.testing.assert_allclose(errors(last, navigator.estimate(700.0)), 0.0, atol=2e-5)


def test_truth_without_the_true_state_is_an_error():
    world = World()
    navigator = TruthNavigator(DynamicsOptions())
    navigator.start(world.problem(np.random.default_rng(0)))
    with pytest.raises(ComponentError, match="without the true state"):
        navigator.update(Readings(0, 0.0, 0.0, np.array([1.0, 0, 0, 0])))


def test_an_impulse_adds_the_covariance_of_its_errors():
    """Against a sample of impulses with errors of size and direction."""
    thrusters = ThrusterErrors(size=0.03, direction_rad=0.02)
    world = World()
    navigator = DeadReckoningNavigator(DynamicsOptions(acceleration_m_s2_rthz=0.0))
    navigator.start(world.problem(np.random.default_rng(0), thrusters=thrusters))
    dv = np.array([0.3, -0.5, 0.2])
    before = navigator.estimate(0.0).covariance
    navigator.burned(Burn(0.0, dv))
    added = (navigator.estimate(0.0).covariance - before)[3:, 3:]
    rng = np.random.default_rng(1)
    across = np.linalg.svd(dv[None])[2][1:]
    flown = (1 + 0.03 * rng.standard_normal((20000, 1))) * dv
    flown = flown + np.linalg.norm(dv) * 0.02 * rng.standard_normal((20000, 2)) @ across
    np.testing.assert_allclose(added, np.cov(flown.T), atol=0.03 * np.trace(added))


def test_an_impulse_below_the_least_is_not_carried_out():
    world = World()
    navigator = DeadReckoningNavigator(DynamicsOptions())
    problem = world.problem(np.random.default_rng(0), thrusters=ThrusterErrors(least_m_s=1e-3))
    navigator.start(problem)
    before = navigator.estimate(10.0)
    navigator.burned(Burn(5.0, np.array([0.0, 9e-4, 0.0])))
    np.testing.assert_array_equal(navigator.estimate(10.0).v_rtn_m_s, before.v_rtn_m_s)
    navigator.burned(Burn(6.0, np.array([0.0, 1.1e-3, 0.0])))
    assert navigator.estimate(10.0).v_rtn_m_s[1] > before.v_rtn_m_s[1] + 1e-3
