"""Measures seconds per frame for each stage of a run: ``python benchmarks/stages.py`` prints a table.

The run is real but in this process, with a clock around the public methods of each stage. The first
frame fills caches and compiles and is left out; medians are over the others.
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

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.executor import Executor, FrameResult, FrameWorker
from posse_core._plugins.loading import Plugins, load_plugins
from posse_core._run.plan import make_plan
from posse_core._run.run import run
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._sensor.sensor import Sensor
from posse_core._simulator.simulator import Simulator
from posse_core._sky.sky import Sky
from posse_core._trajectory.build import make_trajectory

STAGES = ("geometry", "annotators", "render", "sky", "sensor")


class Clock:
    """Seconds by stage in the current frame."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def watch(self, owner: type, method: str, stage: str) -> None:
        """Add the time of every call of a method to a stage."""
        original = getattr(owner, method)

        def watched(*arguments: object) -> object:
            start = time.perf_counter()
            try:
                return original(*arguments)
            finally:
                self.seconds[stage] += time.perf_counter() - start

        setattr(owner, method, watched)


class InThisProcess(Executor):
    """Makes frames one after another, and records the seconds of each by stage."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.opening_s = 0.0
        self.frames: list[dict[str, float]] = []

    def run(
        self, make_worker: Callable[[], FrameWorker[Any]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Any]]:
        self._clock.seconds = dict.fromkeys(STAGES, 0.0)
        start = time.perf_counter()
        worker = make_worker()
        self.opening_s = time.perf_counter() - start
        for index in indices:
            self._clock.seconds = dict.fromkeys(STAGES, 0.0)
            start = time.perf_counter()
            made = worker.make(index)
            total = time.perf_counter() - start
            inside = sum(self._clock.seconds.values())
            self.frames.append({**self._clock.seconds, "write": total - inside, "total": total})
            yield FrameResult(index, made)
        worker.close()


def watch_all(clock: Clock, plugins: Plugins, renderer: str) -> None:
    """Put the clock around every stage."""
    clock.watch(RayCaster, "view", "geometry")
    for name in plugins.registry.names("annotator"):
        clock.watch(plugins.registry.load("annotator", name), "annotate", "annotators")
    clock.watch(plugins.registry.load("renderer", renderer), "render", "render")
    clock.watch(Sky, "look", "sky")
    clock.watch(Sky, "environment", "sky")
    clock.watch(Sensor, "expose", "sensor")


def simulated_s(scenario: Scenario, frames: int) -> float:
    """Median seconds of a simulator's frames after the first, in memory and without a folder."""
    times = []
    with Simulator(scenario, load_plugins().registry) as simulator:
        for index in range(frames):
            start = time.perf_counter()
            simulator.frame(simulator.state(index))
            times.append(time.perf_counter() - start)
    return median(times[1:])


@click.command()
@click.option("--scenario", default="aqua", show_default=True)
@click.option("--renderer", default="mitsuba", show_default=True)
@click.option("--frames", default=9, show_default=True, type=click.IntRange(min=2))
def main(scenario: str, renderer: str, frames: int) -> None:
    """Measure the stages of a run with all annotators."""
    plugins = load_plugins()
    chosen = {
        "renderer.name": renderer,
        "frames": frames,
        "annotators": plugins.registry.names("annotator"),
    }
    checked = load_scenario(scenario, plugins.registry, chosen)
    plan = make_plan(checked, plugins.registry)
    start = time.perf_counter()
    make_trajectory(checked, plugins.registry)
    trajectory_s = (time.perf_counter() - start) / frames

    clock = Clock()
    watch_all(clock, plugins, renderer)
    executor = InThisProcess(clock)
    with tempfile.TemporaryDirectory() as folder:
        run(plan, f"{folder}/d", plugins, executor, resume=False, progress=lambda r, *_: r)

    measured = executor.frames[1:]
    rows = {"trajectory": trajectory_s}
    rows |= {stage: median(frame[stage] for frame in measured) for stage in (*STAGES, "write", "total")}
    ratio = simulated_s(checked, frames) / rows["total"]
    camera = checked.camera.camera()
    machine = platform.processor() or platform.machine()
    print(f"{scenario}, {camera.width_px} x {camera.height_px} px, renderer {checked.renderer.name}")
    print(f"{machine}, {os.cpu_count()} cores; medians of {len(measured)} frames")
    warm_up_s = executor.frames[0]["total"]
    print(f"opening a worker took {executor.opening_s:.2f} s, its first frame {warm_up_s:.2f} s")
    print(f"\n{'stage':<12}{'s/frame':>9}{'of total':>10}")
    for stage, seconds in rows.items():
        print(f"{stage:<12}{seconds:>9.4f}{seconds / rows['total']:>10.1%}")
    labels = median((f["geometry"] + f["annotators"]) / f["render"] for f in measured if f["render"])
    print(f"\nlabels / render, median over the frames: {labels:.1%}")
    print(f"a simulator's frame / a run's frame, which is written too: {ratio:.2f}")


if __name__ == "__main__":
    main()
