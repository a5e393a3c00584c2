"""The plan of a run: everything that it needs, checked before the first file is written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._dataset.sensors import SensorInfo
from posse_core._model.scene import Scene
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.model import Scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.sensing import readings_s, sensor_infos
from posse_core._simulator.states import States
from posse_core._trajectory.build import make_trajectory


@dataclass(frozen=True)
class Plan:
    """A scenario with its trajectory, which has one row per frame, its scene and its sensors."""

    scenario: Scenario
    trajectory: Trajectory
    scene: Scene
    sensors: tuple[SensorInfo, ...]


def make_plan(scenario: Scenario, registry: Registry) -> Plan:
    """Propagate the trajectory, build the spacecraft and try the sensors.

    Raises:
        InputError: The orbit, the spacecraft, a sensor or a file of the scenario cannot be used.
    """
    scene = scene_of(scenario, registry)
    trajectory = make_trajectory(scenario, registry)
    States(scenario, scene, registry, trajectory).check_joints()
    longest_s = _longest_s(trajectory)
    for name, choice in scenario.sensors.items():
        readings_s(name, choice, longest_s)
    return Plan(scenario, trajectory, scene, sensor_infos(scenario, registry, scene))


def _longest_s(trajectory: Trajectory) -> float:
    """The longest time from one frame to the next one of its sequence."""
    apart_s = np.diff(trajectory.t_s)[np.diff(trajectory.sequence) == 0]
    return float(max(apart_s, default=0.0))
