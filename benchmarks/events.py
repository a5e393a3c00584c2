"""Cost of an event camera's recording: ``python benchmarks/events.py`` prints a table.

A recording is a series of renders, so what counts is renders per second. Each part of a render is
clocked on the way, and given beside the renderer's own share, which every other way to make events from
renders has too: the ratio depends less on the machine than the times. Means are over recordings, each
made twice, of which the second counts. Processor time counts all threads of this process, and depends
less on what else the machine does.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable

import click
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._imaging.lens import LensRenderer
from posse_core._interfaces.look import Look
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._sensors.events import recording
from posse_core._sensors.events.event_camera import EventCamera
from posse_core._simulator.simulator import Simulator
from posse_core._sky.sky import Sky

PARTS = ("states", "sky", "renderer", "lens", "pixels")


def now() -> FloatArray:
    """(2,) wall-clock time and processor time, s."""
    return np.array([time.perf_counter(), time.process_time()])


class Clock:
    """Seconds by part of the last recording, (2,) each."""

    def __init__(self) -> None:
        self.seconds: dict[str, FloatArray] = {}

    def watch(self, owner: object, name: str, part: str) -> None:
        """Add the time of every call of a function to a part; that of a recording starts anew."""
        original: Callable[..., object] = getattr(owner, name)

        def watched(*arguments: object, **named: object) -> object:
            if part == "recording":
                self.seconds = {name: np.zeros(2) for name in (*PARTS, "recording")}
            start = now()
            try:
                return original(*arguments, **named)
            finally:
                self.seconds[part] = self.seconds.get(part, np.zeros(2)) + now() - start

        setattr(owner, name, watched)


@click.command()
@click.option("--scenario", default="aqua", show_default=True)
@click.option("--renderer", default="raster", show_default=True)
@click.option("--shadow-map-px", default=512, show_default=True, help="of the renderer raster")
@click.option("--renders", default=30, show_default=True, help="in a recording, at least")
@click.option("--recordings", default=5, show_default=True, type=click.IntRange(min=2))
def main(scenario: str, renderer: str, shadow_map_px: int, renders: int, recordings: int) -> None:
    """Measure recordings of 0.1 s at 320 x 240 px."""
    options = {"shadow_map_px": shadow_map_px} if renderer == "raster" else {}
    keys = {
        "type": "events",
        "camera": {"width_px": 320, "height_px": 240, "hfov_deg": 40},
        "window_s": 0.1,
        "least_rate_hz": renders / 0.1,
    }
    changed = {
        "renderer": {"name": renderer, **options},
        "frames": recordings,
        "annotators": [],
        "sensors": {"dvs": keys},
    }
    registry = load_plugins().registry
    clock = Clock()
    for owner, name, part in (
        (Look, "at", "states"),
        (Sky, "look", "sky"),
        (Sky, "environment", "sky"),
        (LensRenderer, "render", "renderer"),
        (ImageSensor, "mean_electrons", "lens"),
        (recording, "advance", "pixels"),
        (EventCamera, "sense", "recording"),
    ):
        clock.watch(owner, name, part)
    rows, made = [], []
    with Simulator(load_scenario(scenario, registry, changed), registry) as simulator:
        for index in range(recordings):
            state = simulator.state(index)
            simulator.frame(state)  # so that a recording does not pay for what is made once
            labels = simulator.frame(state).readings["dvs"][0].labels
            rows.append([clock.seconds[part] / labels["renders"] for part in (*PARTS, "recording")])
            made.append(labels["events"])
    per_render = np.mean(rows, axis=0)
    machine = platform.processor() or platform.machine()
    print(f"{scenario}, 320 x 240 px, renderer {renderer}, {recordings} recordings")
    print(f"{machine}, {os.cpu_count()} cores; {np.mean(made):.0f} events a recording")
    print(
        f"\n{'part of a render':<18}{'processor, ms':>15}{'wall-clock, ms':>16}{'over the renderer':>19}"
    )
    renderer_s = per_render[PARTS.index("renderer"), 1]
    for part, (wall_s, cpu_s) in zip((*PARTS, "recording"), per_render, strict=True):
        print(f"{part:<18}{1e3 * cpu_s:>15.2f}{1e3 * wall_s:>16.2f}{cpu_s / renderer_s:>19.2f}")
    print(f"\n{1 / per_render[-1, 1]:.0f} renders per second of processor time,", end=" ")
    print(f"{1 / per_render[-1, 0]:.0f} per second")


if __name__ == "__main__":
    main()
