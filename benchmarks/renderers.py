"""Each renderer's time at equal noise, start-up and memory: ``python benchmarks/renderers.py``.

Noise is measured from two seeds of each frame, over the craft. A path tracer's variance falls as its
samples grow, so seconds × (noise / the first row's noise)² is what the first row's noise would cost.
The first row is Cycles on the whole image, as a user of bare Blender would render. Each row has a
process of its own. Wall-clock time: run it on an idle machine.
"""

from __future__ import annotations

import os
import platform
import time
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import mean, median

import click
import numpy as np

from posse_core.evaluation.crosscheck.light import noise
from posse_core.evaluation.crosscheck.settings import ScenarioCase
from posse_core.evaluation.crosscheck.silhouette import Geometry
from posse_core.interfaces.renderer import Renderer
from posse_core.model.camera import PixelBox
from posse_core.model.scene import RenderRequest
from posse_core.pipeline.frame_maker import create
from posse_core.plugins import load_plugins
from posse_core.scenario.component import ComponentChoice
from posse_core.scenario.load import load_scenario


@dataclass(frozen=True)
class Row:
    """One way to render: words, renderer with options, and whether the whole image is rendered."""

    words: str
    choice: ComponentChoice
    whole: bool = False


@dataclass(frozen=True)
class Measured:
    """opening_s: open and first frame; memory in MiB after the first and the last frame."""

    opening_s: float
    frame_s: float
    noise: float
    first_mib: float
    last_mib: float
    frames: int


def rows(spp: int) -> list[Row]:
    """What is compared; those whose renderer is not installed are left out."""
    made = [
        Row("blender, whole image", ComponentChoice(name="blender", options={"spp": spp}), whole=True),
        Row("blender, box", ComponentChoice(name="blender", options={"spp": spp})),
        Row("mitsuba llvm", ComponentChoice(name="mitsuba", options={"spp": spp, "variant": "llvm"})),
        Row(
            "mitsuba scalar", ComponentChoice(name="mitsuba", options={"spp": spp, "variant": "scalar"})
        ),
        Row("raster", ComponentChoice(name="raster")),
    ]
    installed = load_plugins().registry.names("renderer")
    return [row for row in made if row.choice.name in installed]


def measure(row: Row, case: ScenarioCase, renders: int) -> Measured:
    """Render the case's frames with two seeds each, over and over, ``renders`` times in all."""
    setting = case.build()
    geometry, camera = Geometry(setting.scene), setting.scene.camera
    whole = PixelBox(0, 0, camera.width_px, camera.height_px)
    boxes = [whole if row.whole else geometry.box(frame) for frame in setting.frames]
    skies = [setting.environment(frame) for frame in setting.frames]
    requests = [
        RenderRequest(frame, box, sky, seed)
        for frame, box, sky in zip(setting.frames, boxes, skies, strict=True)
        for seed in (1, 2)
    ]
    start = time.perf_counter()
    renderer: Renderer = create(load_plugins().registry, "renderer", row.choice)
    renderer.open(setting.scene)
    renderer.render(requests[0])
    opening_s, first_mib = time.perf_counter() - start, memory_mib(os.getpid())
    seconds, noises = [], []
    previous = None
    for i in range(max(renders, len(requests))):
        start = time.perf_counter()
        image = renderer.render(requests[i % len(requests)])
        seconds.append(time.perf_counter() - start)
        if previous is not None and i % 2 and i < len(requests):
            covered = np.asarray(image.coverage > 0)
            noises.append(noise(previous.radiance_rgb, image.radiance_rgb, covered))
        previous = image
    last_mib = memory_mib(os.getpid())
    renderer.close()
    return Measured(opening_s, median(seconds), mean(noises), first_mib, last_mib, len(seconds))


def memory_mib(pid: int) -> float:
    """Resident memory of a process and of those that it started (Linux)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    own = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return own + sum(memory_mib(int(child)) for child in children)


@click.command()
@click.option("--scenario", default="aqua", show_default=True)
@click.option("--frames", default=5, show_default=True, type=click.IntRange(min=1))
@click.option("--renders", default=50, show_default=True, help="Renders in all, for the memory.")
@click.option("--spp", default=64, show_default=True)
@click.option("--width-px", default=1280, show_default=True)
def main(scenario: str, frames: int, renders: int, spp: int, width_px: int) -> None:
    """Measure every renderer that is installed, on frames of the scenario's trajectory."""
    size: dict[str, object] = {"camera.width_px": width_px, "camera.height_px": width_px * 3 // 4}
    listed = rows(spp)
    size["renderer.name"] = listed[0].choice.name
    checked = load_scenario(scenario, load_plugins().registry, size)
    case = ScenarioCase(scenario, checked, "trajectory", frames)
    machine = platform.processor() or platform.machine()
    print(f"{scenario}, {width_px} x {width_px * 3 // 4} px, {spp} samples a pixel, {frames} frames")
    print(f"{machine}, {os.cpu_count()} cores; load before {os.getloadavg()[0]:.1f}\n")
    print(f"{'':<22}{'s/frame':>9}{'noise':>8}{'s at equal noise':>18}{'times':>7}", end="")
    print(f"{'open + first, s':>17}{'MiB':>7}{'MiB, last':>11}{'frames':>8}", flush=True)
    first: Measured | None = None
    for row in listed:
        with get_context("spawn").Pool(1) as pool:
            got = pool.apply(measure, (row, case, renders))
        first = first or got
        equal_s = got.frame_s * (got.noise / first.noise) ** 2 if got.noise > 0 else got.frame_s
        print(f"{row.words:<22}{got.frame_s:>9.3f}{got.noise:>8.3f}{equal_s:>18.3f}", end="")
        print(f"{first.frame_s / equal_s:>7.1f}{got.opening_s:>17.2f}{got.first_mib:>7.0f}", end="")
        print(f"{got.last_mib:>11.0f}{got.frames:>8}", flush=True)


if __name__ == "__main__":
    main()
