"""The problem of a flight: what a scenario says of it, resolved for truth, navigator and controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.start import Start
from posse_core._errors import InputError
from posse_core._flight.chaser import start_error
from posse_core._interfaces.controller import Cone, ControlProblem, Safety, Waypoint
from posse_core._interfaces.navigator import Estimate, NavigationProblem, ThrusterErrors
from posse_core._interfaces.propagator import FlightPropagator, PropagationProblem
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import create
from posse_core._scenario.flight import (
    FlightConfig,
    GoalConfig,
    NavigationErrorsConfig,
    SafetyConfig,
)
from posse_core._scenario.model import Scenario
from posse_core._trajectory.build import scenario_problem
from posse_core._trajectory.problem import starts_of


@dataclass(frozen=True)
class FlightProblem:
    """What a flight is made of.

    Attributes:
        config: the scenario's key ``flight``.
        seed: of every random draw.
        propagator: flies the truth.
        motion: the planned motion, for the propagator; its times are those of the frames.
        start: the true start of the chaser, which differs from the planned one by a random error.
        navigation: what the navigator knows.
        control: what the controller is to achieve.
    """

    config: FlightConfig
    seed: int
    propagator: FlightPropagator
    motion: PropagationProblem
    start: Start
    navigation: NavigationProblem
    control: ControlProblem

    @property
    def frames_s(self) -> FloatArray:
        """(F,) instants of the frames, seconds since the epoch."""
        return self.motion.t_s


def flight_problem(scenario: Scenario, spacecraft: Spacecraft, registry: Registry) -> FlightProblem:
    """Resolve a scenario's flight.

    Raises:
        InputError: the scenario has no flight, its propagator cannot fly, it has several relative orbits
            or a forced one, or the controller needs a goal.
    """
    config = scenario.flight
    if config is None:
        raise InputError(
            "flight: missing; a scenario for 'posse fly' says there what the chaser does, see"
            " 'posse describe scenario'"
        )
    propagator = create(registry, "propagator", scenario.propagator)
    if not isinstance(propagator, FlightPropagator):
        raise InputError(
            f"propagator: {scenario.propagator.name!r} cannot carry on from an impulse; name one that"
            " can, such as roe or nonlinear"
        )
    count = int(config.duration_s / config.period_s + 1e-9) + 1
    frames_s = np.linspace(0.0, (count - 1) * config.period_s, count)
    motion = scenario_problem(scenario, propagator, frames_s)
    if len(motion.starts) != 1 or motion.forced is not None:
        raise InputError(
            "relative: a flight starts on one natural relative orbit; give roe_m, state_rtn or a design"
            " that is one"
        )
    errors = config.errors
    thrusters = thruster_errors(errors)
    camera_attitude_rad = float(np.radians(errors.camera_attitude_deg))
    waypoints = () if config.goal is None else _waypoints(config.goal, propagator, motion, config)
    if (
        not waypoints
        and "no-waypoints" not in registry.spec("controller", config.controller.name).capabilities
    ):
        raise InputError(
            f"flight.goal: missing, and controller {config.controller.name!r} needs one; give waypoints"
            " or an orbit"
        )
    planned = motion.starts[0]
    error, sigma = start_error(errors.start, scenario.seed)
    rtn = planned.rtn + error
    return FlightProblem(
        config=config,
        seed=scenario.seed,
        propagator=propagator,
        motion=motion,
        start=Start.from_rtn(planned.target, rtn[:3], rtn[3:], where="relative, with its start error"),
        navigation=NavigationProblem(
            epoch=motion.epoch,
            target=motion.target,
            start=Estimate(0.0, planned.rtn[:3], planned.rtn[3:], np.diag(sigma**2)),
            camera=scenario.camera.camera(),
            radius_m=spacecraft.radius_m,
            symmetries=np.reshape(np.array(spacecraft.symmetries, dtype=np.float64), (-1, 3, 3)),
            inertia_kg_m2=None if config.inertia_kg_m2 is None else np.array(config.inertia_kg_m2),
            thrusters=thrusters,
            camera_attitude_rad=camera_attitude_rad,
            period_s=config.period_s,
        ),
        control=ControlProblem(
            epoch=motion.epoch,
            target=motion.target,
            waypoints=waypoints,
            burns_s=frames_s[:-1] + config.burn_after_s,
            plan=motion.burns,
            largest_m_s=np.inf if config.largest_impulse_m_s is None else config.largest_impulse_m_s,
            safety=_safety(config.safety),
            thrusters=thrusters,
        ),
    )


def thruster_errors(errors: NavigationErrorsConfig) -> ThrusterErrors:
    """The errors of impulses as navigators and controllers are told them."""
    return ThrusterErrors(
        errors.impulse_size, np.radians(errors.impulse_direction_deg), errors.least_impulse_m_s
    )


def _waypoints(
    goal: GoalConfig, propagator: FlightPropagator, motion: PropagationProblem, config: FlightConfig
) -> tuple[Waypoint, ...]:
    if goal.waypoints is not None:
        return tuple(
            Waypoint(
                point.t_s, point.t_s + point.hold_s, np.array(point.r_rtn_m), np.array(point.v_rtn_m_s)
            )
            for point in goal.waypoints
        )
    assert goal.orbit is not None  # the model has exactly one of the two
    orbit = goal.orbit
    starts = starts_of(motion.target, orbit.relative)
    if len(starts) != 1 or not np.any(starts[0].rtn):
        raise InputError("flight.goal.orbit.relative: give one natural relative orbit")
    t_s = np.arange(orbit.from_s, config.duration_s + 1e-9, orbit.every_s)
    rtn = propagator.fly(motion, starts[0], t_s).rtn
    return tuple(Waypoint(t, t, row[:3], row[3:]) for t, row in zip(t_s.tolist(), rtn, strict=True))


def _safety(config: SafetyConfig) -> Safety:
    cone = None
    if config.cone is not None:
        axis = np.array(config.cone.axis_rtn)
        half_angle_rad = float(np.radians(config.cone.half_angle_deg))
        cone = Cone(axis / np.linalg.norm(axis), half_angle_rad, config.cone.length_m)
    keep_out_m = None if config.keep_out_m is None else np.array(config.keep_out_m)
    return Safety(keep_out_m, cone, config.passive_s)
