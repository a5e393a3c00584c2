"""Everything that a run needs, checked before the first file is written."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.orbit import orbit_period_s
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.spacecraft import Spacecraft
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.registry import Registry
from posse_core._run.frame_maker import create
from posse_core._scenario.model import Scenario
from posse_core._trajectory.trajectory import build_trajectory


@dataclass(frozen=True)
class Plan:
    """A scenario with its trajectory, one entry a frame, and its spacecraft."""

    scenario: Scenario
    trajectory: Trajectory
    spacecraft: Spacecraft


def make_plan(scenario: Scenario, registry: Registry) -> Plan:
    """Propagate, and build the spacecraft.

    Raises:
        InputError: the orbit, the model or a file of the scenario cannot be used.
    """
    craft: Spacecraft = create(registry, "scene", scenario.target).build()
    return Plan(scenario, make_trajectory(scenario, registry), craft)


def make_trajectory(scenario: Scenario, registry: Registry) -> Trajectory:
    """The trajectory of a scenario's frames."""
    propagator: Propagator = create(registry, "propagator", scenario.propagator)
    problem = PropagationProblem(
        orbit=scenario.orbit,
        relative=scenario.relative,
        t_s=times_s(scenario),
        constants=scenario.constants,
    )
    trajectory = build_trajectory(
        propagator=propagator, problem=problem, attitude=scenario.attitude, seed=scenario.seed
    )
    return evenly_spread(trajectory, scenario.frames)


def times_s(scenario: Scenario) -> FloatArray:
    """(T,) seconds after the epoch at which the scenario asks for frames."""
    return scenario.times.seconds(partial(orbit_period_s, scenario.orbit, scenario.constants))


def evenly_spread(trajectory: Trajectory, frames: int | None) -> Trajectory:
    """Only ``frames`` of the trajectory's, evenly spread from first to last; all, if None."""
    if frames is None or frames >= len(trajectory):
        return trajectory
    chosen = np.linspace(0, len(trajectory) - 1, frames).round().astype(int)
    arrays = {
        field.name: getattr(trajectory, field.name)[chosen]
        for field in fields(trajectory)
        if field.name != "epoch_utc"
    }
    return replace(trajectory, **arrays)
