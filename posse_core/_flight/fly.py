"""Flying a scenario: its folder, one flight or many, and going on where one was interrupted."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import FLIGHT, FLIGHT_PAGE, SCENARIO, TRAJECTORY
from posse_core._detection.known import target_shapes
from posse_core._errors import InputError
from posse_core._evaluation.flight import FlightSummary, summarise
from posse_core._files.atomic import write_bytes
from posse_core._files.flight import load_flight, save_flight
from posse_core._files.store import is_remote
from posse_core._files.trajectory import save_trajectory
from posse_core._flight.eye import open_eye
from posse_core._flight.loop import Flight
from posse_core._flight.problem import FlightProblem, flight_problem
from posse_core._flight.readings_log import ReadingsLog
from posse_core._flight.record import flight_record, joined
from posse_core._flight.watch import Step
from posse_core._guidance.optimum import least_dv_m_s
from posse_core._interfaces.executor import Executor, FrameResult
from posse_core._model.flight_record import FlightRecord
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.loading import Plugins, load_plugins
from posse_core._randomness import derived_seed
from posse_core._run.inputs import as_begun, inputs_of, write_inputs
from posse_core._run.recording import Recording, recording
from posse_core._run.worker import write_frame, write_renderer
from posse_core._scenario.load import dump_scenario, load_scenario
from posse_core._scenario.model import Scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.sensing import sensor_infos
from posse_core._simulator.simulator import Simulator
from posse_core._view.flight.page import write_flight_page

Progress = Callable[[Iterable[Step], int], Iterable[Step]]
"""Wraps the steps of a flight to show its progress: (steps, planned number of frames)."""


def fly(
    scenario: Scenario, out: str | None, plugins: Plugins, *, resume: bool, progress: Progress
) -> FlightRecord:
    """Fly a scenario.

    Args:
        scenario: with the key ``flight``.
        out: folder of the flight's dataset; None writes nothing.
        plugins: that are installed.
        resume: go on with the flight in ``out``; the frames that are there are not rendered again.
        progress: shows the progress.

    Raises:
        InputError: the scenario has no flight or one that cannot be flown, or the folder cannot be used.
        ComponentError: a component failed. The frames that were made are in the folder.
    """
    registry = plugins.registry
    scene = scene_of(scenario, registry)
    craft = scene.spacecraft
    problem = flight_problem(scenario, craft, registry)
    if out is None:
        with contextlib.ExitStack() as stack:
            simulator = stack.enter_context(Simulator(scenario, registry))
            flight = _flight(scenario, problem, craft, simulator, plugins, stack)
            steps = list(progress(flight.steps({}), len(problem.frames_s)))
        return flight_record(steps, problem.control, _least(problem))
    if is_remote(out):
        raise InputError(f"--out {out}: a flight is written to a folder of this machine; name one")
    frames = len(problem.frames_s)
    sensors = sensor_infos(scenario, registry, scene)
    with recording(out, scenario, scene, frames, plugins, sensors=sensors, resume=resume) as dataset:
        if dataset.is_complete:
            return load_flight(dataset.folder / FLIGHT)
        with contextlib.ExitStack() as stack:
            simulator = stack.enter_context(Simulator(scenario, registry))
            write_renderer(simulator, dataset.store)
            flight = _flight(scenario, problem, craft, simulator, plugins, stack)
            log = ReadingsLog(dataset.folder)
            known = log.recover(dataset.done)
            dataset.begin()
            steps = list(progress(_recorded(flight.steps(known), dataset, log), frames))
        record = flight_record(steps, problem.control, _least(problem))
        save_trajectory(joined([step.row for step in steps]), dataset.folder / TRAJECTORY)
        save_flight(record, dataset.folder / FLIGHT)
        dataset.finish({}, frames=len(steps))
        write_flight_page(Dataset(dataset.folder), record, dataset.folder / FLIGHT_PAGE)
    return record


def _flight(
    scenario: Scenario,
    problem: FlightProblem,
    craft: Spacecraft,
    simulator: Simulator,
    plugins: Plugins,
    stack: contextlib.ExitStack,
) -> Flight:
    """The flight; what it opens is closed with ``stack``."""
    measurement = problem.config.measurement
    expecting = None
    if measurement.correction is not None:
        # Noise and clouds are drawn anew: the chaser knows neither.
        own = {
            "renderer": measurement.correction,
            "seed": derived_seed(scenario.seed, -1, "expected-frames"),
        }
        expecting = stack.enter_context(Simulator(scenario.model_copy(update=own), plugins.registry))
    shapes = None
    if measurement.refiner is not None:
        shapes = target_shapes(craft, plugins.registry, measurement.refiner)
    eye = open_eye(measurement, craft, simulator.camera, scenario.seed, plugins.registry, shapes)
    stack.callback(eye.close)
    return Flight(scenario, problem, simulator, eye, plugins.registry, expecting)


def _least(problem: FlightProblem) -> float:
    return least_dv_m_s(problem.control, problem.start) if problem.control.waypoints else np.nan


def _recorded(steps: Iterable[Step], dataset: Recording, log: ReadingsLog) -> Iterator[Step]:
    """Write each new frame. Its readings come first: a frame that is logged is never without them,
    unless their file was damaged later. Such a frame is made again, but it is not logged twice."""
    for step in steps:
        if step.frame is not None:
            made = write_frame(step.frame, dataset.store)
            log.append(step.readings)
            if made.labels.index not in dataset.done:
                dataset.add(made)
        yield step


@dataclass(frozen=True)
class FlightMade:
    """The outcome of one of many flights.

    Attributes:
        seed: of its random draws.
        folder: its dataset.
        summary: its key figures.
    """

    seed: int
    folder: str
    summary: FlightSummary


class FlightWorker:
    """Flies a scenario with other seeds: flight ``index`` has the scenario's seed plus ``index``."""

    def __init__(self, text: str, folder: str, resume: bool) -> None:
        self._plugins = load_plugins()
        self._scenario_file, self._folder, self._resume = text, folder, resume

    def make(self, index: int) -> FlightMade:
        """Fly once, in a folder of its own."""
        scenario = load_scenario(self._scenario_file, self._plugins.registry)
        seed = scenario.seed + index
        folder = f"{self._folder}/seed-{seed:03d}"
        resume = self._resume and Path(folder).exists()
        record = fly(
            scenario.model_copy(update={"seed": seed}),
            folder,
            self._plugins,
            resume=resume,
            progress=lambda steps, _: steps,
        )
        return FlightMade(seed, folder, summarise(record, Dataset(Path(folder)).spacecraft.symmetries))

    def close(self) -> None:
        """Do nothing: a flight frees what it uses when it ends."""


def fly_many(
    scenario: Scenario, out: str, seeds: int, executor: Executor, *, resume: bool
) -> Iterator[FrameResult[FlightMade]]:
    """Fly a scenario with ``seeds`` seeds, each in its own folder within ``out``.

    Raises:
        InputError: the folder cannot be used.
    """
    folder = Path(out)
    inputs = inputs_of(scenario)
    path = folder / SCENARIO
    if path.exists():
        if not resume:
            raise InputError(f"--out {out}: contains flights; choose another folder, or use --resume")
        registry = load_plugins().registry
        write_inputs(folder, as_begun(folder, scenario, inputs, registry, out), {})
    elif folder.exists() and os.listdir(folder):
        raise InputError(f"--out {out}: is not empty and contains no flights; choose another folder")
    else:
        folder.mkdir(parents=True, exist_ok=True)
        write_inputs(folder, inputs, {})
        write_bytes(path, dump_scenario(inputs.scenario).encode())
    yield from executor.run(partial(FlightWorker, str(path), str(folder), resume), range(seeds))
