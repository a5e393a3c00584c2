"""Measures seconds per frame for each stage of a run: ``python benchmarks/stages.py`` prints a table.

The run is real but in this process, with a clock around the public methods of each stage. The first
frame fills caches and compiles and is left out; medians are over the others. Processor time counts all
threads of this process, and depends less on what else the machine does; the work of a renderer in a
process of its own, as Blender, is only in the wall-clock time.
"""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from statistics import median
from typing import Any

import click
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._geometry.raycast import RayCaster
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._interfaces.executor import Executor, FrameResult, FrameWorker
from posse_core._plugins.loading import Plugins, load_plugins
from posse_core._run.plan import make_plan
from posse_core._run.run import run
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._simulator.simulator import Simulator
from posse_core._sky.sky import Sky
from posse_core._trajectory.build import make_trajectory

STAGES = ("geometry", "annotators", "render", "sky", "sensor")


def now() -> FloatArray:
    """(2,) wall-clock time and processor time, s."""
    return np.array([time.perf_counter(), time.process_time()])


class Clock:
    """Wall-clock and processor seconds by stage in the current frame, (2,) each."""

    def __init__(self) -> None:
        self.seconds: dict[str, FloatArray] = {}

    def reset(self) -> None:
        """Begin a frame."""
        self.seconds = {stage: np.zeros(2) for stage in STAGES}

    def watch(self, owner: type, method: str, stage: str) -> None:
        """Add the time of every call of a method to a stage."""
        original = getattr(owner, method)

        def watched(*arguments: object) -> object:
            start = now()
            try:
                return original(*arguments)
            finally:
                self.seconds[stage] += now() - start

        setattr(owner, method, watched)


class InThisProcess(Executor):
    """Makes frames one after another, and records the seconds of each by stage."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.opening_s = np.zeros(2)
        self.frames: list[dict[str, FloatArray]] = []

    def run(
        self, make_worker: Callable[[], FrameWorker[Any]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Any]]:
        self._clock.reset()
        start = now()
        worker = make_worker()
        self.opening_s = now() - start
        for index in indices:
            self._clock.reset()
            start = now()
            made = worker.make(index)
            total = now() - start
            inside = np.sum(list(self._clock.seconds.values()), axis=0)
            self.frames.append({**self._clock.seconds, "write": total - inside, "total": total})
            yield FrameResult(index, made)
        worker.close()


def watch_all(clock: Clock, plugins: Plugins, renderer: str) -> None:
    """Put the clock around every stage."""
    clock.watch(RayCaster, "views", "geometry")
    for name in plugins.registry.names("annotator"):
        clock.watch(plugins.registry.load("annotator", name), "annotate", "annotators")
    clock.watch(plugins.registry.load("renderer", renderer), "render", "render")
    clock.watch(Sky, "look", "sky")
    clock.watch(Sky, "environment", "sky")
    clock.watch(ImageSensor, "expose", "sensor")


def simulated_s(scenario: Scenario, frames: int) -> FloatArray:
    """(2,) median seconds of a simulator's frames after the first, in memory and without a folder."""
    times = []
    with Simulator(scenario, load_plugins().registry) as simulator:
        for index in range(frames):
            start = now()
            simulator.frame(simulator.state(index))
            times.append(now() - start)
    return np.median(times[1:], axis=0)


@click.command()
@click.option("--scenario", default="aqua", show_default=True)
@click.option("--renderer", default="mitsuba", show_default=True)
@click.option("--frames", default=9, show_default=True, type=click.IntRange(min=2))
@click.option("--scale", default=1.0, show_default=True, help="Of the camera's image: camera.scale.")
def main(scenario: str, renderer: str, frames: int, scale: float) -> None:
    """Measure the stages of a run with all annotators."""
    plugins = load_plugins()
    chosen = {"renderer.name": renderer, "frames": frames, "camera.scale": scale}
    usual = load_scenario(scenario, plugins.registry, chosen)
    every = plugins.registry.names("annotator")
    checked = load_scenario(scenario, plugins.registry, {**chosen, "annotators": every})
    plan = make_plan(checked, plugins.registry)
    start = now()
    make_trajectory(checked, plugins.registry)
    trajectory_s = (now() - start) / frames

    clock = Clock()
    watch_all(clock, plugins, renderer)
    executor = InThisProcess(clock)
    with tempfile.TemporaryDirectory() as folder:
        run(plan, f"{folder}/d", plugins, executor, resume=False, progress=lambda r, *_: r)

    measured = executor.frames[1:]
    rows = {"trajectory": trajectory_s}
    for stage in (*STAGES, "write", "total"):
        rows[stage] = np.median([frame[stage] for frame in measured], axis=0)
    rows["in memory"] = simulated_s(checked, frames)
    usual_s = simulated_s(usual, frames)
    camera = checked.camera.camera()
    machine = platform.processor() or platform.machine()
    print(f"{scenario}, {camera.width_px} x {camera.height_px} px, renderer {checked.renderer.name}")
    print(f"{machine}, {os.cpu_count()} cores; medians of {len(measured)} frames")
    warm_up_s = executor.frames[0]["total"]
    print("processor time (wall-clock time):")
    print(f"opening a worker took {executor.opening_s[1]:.2f} s ({executor.opening_s[0]:.2f} s),")
    print(f"its first frame {warm_up_s[1]:.2f} s ({warm_up_s[0]:.2f} s)")
    print(f"\n{'stage':<12}{'processor, s':>14}{'wall-clock, s':>15}{'of total':>10}")
    for stage, (wall_s, cpu_s) in rows.items():
        print(f"{stage:<12}{cpu_s:>14.4f}{wall_s:>15.4f}{cpu_s / rows['total'][1]:>10.1%}")
    labels = median(
        (f["geometry"] + f["annotators"])[0] / f["render"][0] for f in measured if f["render"][0]
    )
    beside = median(
        (f["sky"] + f["sensor"] + f["write"])[1] / f["render"][1] for f in measured if f["render"][1]
    )
    print(f"\nlabels / render by wall-clock time, median over the frames: {labels:.1%}")
    print(f"(sky + sensor + write) / render by processor time, likewise: {beside:.2f}")
    print(
        f"a simulator's frames per second by wall-clock time: {1 / rows['in memory'][0]:.1f} with all"
        f" labels, {1 / usual_s[0]:.1f} with those that the scenario has by itself"
    )
    print("total is a run's frame, which is written; in memory is a simulator's frame, which is not")


if __name__ == "__main__":
    main()
