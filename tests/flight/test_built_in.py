"""The built-in flights: what each says resolves, and its start and goal are where a chaser may be."""

import numpy as np
import pytest

from posse_core import create
from posse_core._flight.problem import FlightProblem, flight_problem
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.built_in_names import built_in_names
from posse_core._scenario.load import load_scenario, scenario_members

FLIGHTS = [name for name in built_in_names() if name.startswith("fly-")]


@pytest.fixture(scope="module")
def problems() -> dict[str, FlightProblem]:
    registry = load_plugins().registry
    made = {}
    for name in FLIGHTS:
        scenario = load_scenario(name, registry)
        craft = registry.create("scene", scenario.target.name).build()
        made[name] = flight_problem(scenario, craft, registry)
    return made


def test_every_scenario_with_a_flight_is_named_as_one():
    registry = load_plugins().registry
    with_flight = {
        name
        for name in built_in_names()
        if any(
            load_scenario(member.source, registry).flight is not None
            for member in scenario_members(name)
        )
    }
    assert with_flight == set(FLIGHTS)


@pytest.mark.parametrize("name", FLIGHTS)
def test_start_and_goal_are_outside_the_target_and_where_the_chaser_may_be(problems, name):
    problem = problems[name]
    safety = problem.control.safety
    start = problem.navigation.start.r_rtn_m
    places = np.array([start, *(point.r_rtn_m for point in problem.control.waypoints)])
    assert np.linalg.norm(places, axis=1).min() > problem.navigation.radius_m
    if safety.keep_out_m is not None:
        assert np.linalg.norm(places / safety.keep_out_m, axis=1).min() > 1
    if safety.cone is not None:
        along = places @ safety.cone.axis_rtn
        off_rad = np.arccos(along / np.linalg.norm(places, axis=1))
        near = along < safety.cone.length_m
        assert (off_rad[near] < safety.cone.half_angle_rad).all()


@pytest.mark.parametrize("name", FLIGHTS)
def test_navigator_and_controller_take_the_flight(problems, name):
    problem = problems[name]
    navigator = create("navigator", problem.config.navigator.name, **problem.config.navigator.options)
    navigator.start(problem.navigation)
    estimate = navigator.estimate(0.0)
    np.testing.assert_allclose(estimate.r_rtn_m, problem.navigation.start.r_rtn_m, atol=1e-9)
    controller = create(
        "controller", problem.config.controller.name, **problem.config.controller.options
    )
    controller.start(problem.control)


def test_the_tumbling_target_turns_with_the_inertia_that_the_chaser_knows(problems):
    scenario = load_scenario("fly-tumbling", load_plugins().registry)
    known = problems["fly-tumbling"].navigation.inertia_kg_m2
    np.testing.assert_array_equal(known, np.diag(scenario.attitude.target.options["moments_kg_m2"]))
