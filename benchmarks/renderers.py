"""Compares renderers: CPU-seconds per frame at equal noise, time to start, memory.

``python benchmarks/renderers.py`` prints a table. Each renderer runs in its own process, and the CPU
time of this process and its children counts. They run in turn, and the least of several rounds counts,
so that other programs and a changing clock of the machine matter little. Blender is found as the plugin
finds it (POSSE_BLENDER_PYTHON). The script needs Linux, since it reads /proc.

Noise is the difference on the spacecraft's pixels between seeds; each round has its own seed. It is the
root mean square over the mean, with radiance clipped at that of a white plate that faces the Sun.
Brighter pixels are a few glints, which hardly change the image but would make up all of the noise.

The reference is Cycles with equally many samples in every pixel of the whole image. Its noise falls with
the square root of its time, so its cost is scaled to the noise that another renderer has with its own
options, pose by pose; the ratios of the poses are averaged as logarithms.

With ``--blenderproc PYTHON`` the reference is BlenderProc, as ``blenderproc_worker.py`` runs it in that
Python, of the same scene: its whole image with depth, normals and segments.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import FileIO
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from statistics import fmean, geometric_mean
from typing import Any

import click
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._errors import PosseError
from posse_core._evaluation.crosscheck.settings import ScenarioCase, Setting
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, Standpoint
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import PixelBox
from posse_core._model.mount import Mount
from posse_core._model.scene import Radiance, RenderRequest
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.component import ComponentChoice, create
from posse_core._scenario.load import load_scenario
from posse_core._simulator.light import BOX_MARGIN_PX

MEMORY_SPP = 4
CANDIDATES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("blender", "blender", {}),
    ("mitsuba llvm", "mitsuba", {"variant": "llvm"}),
    ("mitsuba scalar", "mitsuba", {"variant": "scalar"}),
    ("raster", "raster", {}),
)
SAMPLED = ("mitsuba", "blender")
BLENDERPROC_WORKER = Path(__file__).with_name("blenderproc_worker.py")


@dataclass(frozen=True)
class Cost:
    """The cost of one call, in seconds."""

    cpu_s: float
    wall_s: float


@contextmanager
def measured() -> Iterator[Callable[[], Cost]]:
    """Yield a function that afterwards returns the cost of the block in this process and its
    children."""
    cpu, wall = _cpu_s(os.getpid()), time.perf_counter()
    done: list[Cost] = []
    yield lambda: done[0]
    done.append(Cost(_cpu_s(os.getpid()) - cpu, time.perf_counter() - wall))


def _family(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(member for child in children for member in _family(int(child)))]


def _cpu_s(pid: int) -> float:
    """User and system time of a process, its living children, and those that it has waited for,
    seconds."""
    ticks = 0
    for member in _family(pid):
        stat = Path(f"/proc/{member}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks += sum(map(int, stat[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def _memory_mb(pid: int) -> float:
    pages = sum(
        int(Path(f"/proc/{member}/statm").read_text(encoding="ascii").split()[1])
        for member in _family(pid)
    )
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


class Bench:
    """Measures a renderer in the renderer's own process."""

    def __init__(self, case: ScenarioCase) -> None:
        self._setting: Setting = case.build()
        caster = RayCaster(self._setting.scene)
        camera = self._setting.scene.camera
        self._boxes = [
            caster.view(f.craft).box.grown(BOX_MARGIN_PX, camera) for f in self._setting.frames
        ]
        self._skies = [self._setting.environment(frame) for frame in self._setting.frames]
        self._renderer: Renderer | None = None
        self._images: list[list[Radiance]] = [[] for _ in self._boxes]

    def open(self, name: str, options: Mapping[str, Any]) -> Cost:
        """Replace the open renderer, and return the cost of opening and of a first frame."""
        self.close()
        with measured() as cost:
            choice = ComponentChoice(name=name, options=dict(options))
            self._renderer = create(load_plugins().registry, "renderer", choice)
            self._renderer.open(self._setting.scene)
            self._render(0, self._boxes[0], seed=9)
        return cost()

    def boxes(self, seed: int) -> list[Cost]:
        """The cost of each frame's box. The images are kept for :meth:`noise`."""
        costs = []
        for i, (images, box) in enumerate(zip(self._images, self._boxes, strict=True)):
            image, cost = self._timed(i, box, seed)
            images.append(image)
            costs.append(cost)
        return costs

    def wholes(self) -> list[Cost]:
        """The cost of each frame's whole image."""
        camera = self._setting.scene.camera
        image = PixelBox(0, 0, camera.width_px, camera.height_px)
        return [self._timed(i, image, seed=0)[1] for i in range(len(self._boxes))]

    def noise(self) -> list[float]:
        """The noise of each frame over the images of its box so far; see the module's docstring."""
        return [
            _noise(images, frame.craft.sun_irradiance_rgb_w_m2 / np.pi)
            for images, frame in zip(self._images, self._setting.frames, strict=True)
        ]

    def memory(self, count: int) -> tuple[float, float]:
        """Memory in MB after the fifth and after the last of ``count`` more frames."""
        used = []
        for k in range(count):
            i = k % len(self._boxes)
            self._render(i, self._boxes[i], seed=k)
            used.append(_memory_mb(os.getpid()))
        return used[min(4, count - 1)], used[-1]

    def labels(self) -> Cost:
        """The mean cost per frame of exact geometry and all annotators."""
        registry = load_plugins().registry
        scene = self._setting.scene
        annotators = [registry.create("annotator", name) for name in registry.names("annotator")]
        caster = RayCaster(scene)
        with measured() as cost:
            for frame in self._setting.frames:
                look = Look(Standpoint(frame, Mount(), 0, "annotator"), scene, lambda camera: caster)
                for annotator in annotators:
                    annotator.annotate(look)
        return Cost(*(value / len(self._boxes) for value in (cost().cpu_s, cost().wall_s)))

    def blenderproc(
        self, python: str, spp: int, threads: int, seeds: Sequence[int]
    ) -> tuple[list[Cost], list[float]]:
        """The cost of each frame by BlenderProc, the least of the seeds, and its noise.

        Raises:
            PosseError: BlenderProc failed.
        """
        import posse_render_blender
        from posse_render_blender.options import BlenderOptions
        from posse_render_blender.renderer import frame_message, scene_message
        from posse_render_blender.worker import wire

        scene, frames = self._setting.scene, self._setting.frames
        options = BlenderOptions(spp=spp, threads=threads)
        messages = {"scene": scene_message(scene, options)}
        for i, (frame, box) in enumerate(zip(frames, self._boxes, strict=True)):
            request = RenderRequest(frame.craft, box, self._skies[i], 0)
            messages[f"frame{i}"] = frame_message(request, scene, 0.0)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for key, message in messages.items():
                with FileIO(str(folder / key), "w") as file:
                    wire.send(file, message)
            worker = Path(posse_render_blender.__file__).parent / "worker"
            words = [python, str(BLENDERPROC_WORKER), str(worker), name, str(spp), *map(str, seeds)]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            if done.returncode:
                told = f"{done.stdout[-1000:]}{done.stderr[-1000:]}".strip()
                raise PosseError(f"{python}: BlenderProc ended with {done.returncode}: {told}")
            costs: list[Cost] = []
            for rows in json.loads((folder / "costs.json").read_text(encoding="utf-8")).values():
                costs = _least(costs, [Cost(*row) for row in rows])
            noise = []
            for i, (frame, box) in enumerate(zip(frames, self._boxes, strict=True)):
                images = [np.load(folder / f"{seed}-{i}.npy")[box.slices] for seed in seeds]
                radiance = [Radiance(box, image[..., :3], image[..., 3]) for image in images]
                noise.append(_noise(radiance, frame.craft.sun_irradiance_rgb_w_m2 / np.pi))
        return costs, noise

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None

    def _timed(self, i: int, box: PixelBox, seed: int) -> tuple[Radiance, Cost]:
        with measured() as cost:
            image = self._render(i, box, seed)
        return image, cost()

    def _render(self, i: int, box: PixelBox, seed: int) -> Radiance:
        assert self._renderer is not None
        return self._renderer.render(
            RenderRequest(self._setting.frames[i].craft, box, self._skies[i], seed)
        )


def _noise(images: Sequence[Radiance], white_rgb: AnyArray) -> float:
    covered = np.all([image.coverage > 0.5 for image in images], axis=0)
    seen = [np.minimum(image.radiance_rgb, white_rgb)[covered].sum(axis=-1) for image in images]
    light = np.array(seen, dtype=np.float64)
    return float(np.sqrt(light.var(axis=0, ddof=1).mean()) / light.mean())


def _serve(case: ScenarioCase, pipe: Connection) -> None:
    """Run in the child process: make a bench and call the requested methods."""
    bench = Bench(case)
    while (call := pipe.recv()) is not None:
        method, arguments = call
        try:
            pipe.send((getattr(bench, method)(*arguments), None))
        except PosseError as error:
            pipe.send((None, str(error)))
    bench.close()


class Remote:
    """A bench in a process of its own."""

    def __init__(self, case: ScenarioCase) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_serve, args=(case, theirs), daemon=True)
        self._process.start()

    def ask(self, method: str, *arguments: Any) -> Any:
        """Call a method of the bench and return its result.

        Raises:
            click.ClickException: the renderer failed.
        """
        self._pipe.send((method, arguments))
        answer, failure = self._pipe.recv()
        if failure is not None:
            raise click.ClickException(failure)
        return answer

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join()


@dataclass
class Entry:
    """A renderer in its process, and a line of the table. Costs (the least of the rounds) and noise are
    per frame."""

    title: str
    name: str
    options: Mapping[str, Any]
    remote: Remote
    start: Cost
    boxes: list[Cost] = field(default_factory=list)
    wholes: list[Cost] = field(default_factory=list)
    noise: list[float] = field(default_factory=list)

    @property
    def sampled(self) -> bool:
        """Whether the renderer samples, so that its images have noise."""
        return self.name in SAMPLED

    def take_turn(self, seed: int) -> None:
        """Measure boxes and whole images once more."""
        self.boxes = _least(self.boxes, self.remote.ask("boxes", seed))
        self.wholes = _least(self.wholes, self.remote.ask("wholes"))

    def memory_mb(self, frames: int) -> tuple[float, float]:
        """As :meth:`Bench.memory`, with few samples, since memory does not depend on them."""
        if self.sampled:
            self.remote.ask("open", self.name, {**self.options, "spp": MEMORY_SPP})
        fifth_and_last: tuple[float, float] = self.remote.ask("memory", frames)
        return fifth_and_last


@dataclass(frozen=True)
class Reference:
    """What the renderers are compared with: costs of whole images and their noise, per frame."""

    title: str
    wholes: Sequence[Cost]
    noise: Sequence[float]


def _least(before: Sequence[Cost], now: Sequence[Cost]) -> list[Cost]:
    if not before:
        return list(now)
    pairs = zip(before, now, strict=True)
    return [one if one.cpu_s <= other.cpu_s else other for one, other in pairs]


def enter(case: ScenarioCase, title: str, name: str, options: dict[str, Any]) -> Entry:
    """Open one renderer."""
    remote = Remote(case)
    try:
        return Entry(title, name, options, remote, remote.ask("open", name, options))
    except BaseException:
        remote.close()
        raise


@click.command()
@click.option("--scenario", default="aqua", show_default=True)
@click.option("--frames", default=4, show_default=True, help="Poses of crosscheck at its ranges.")
@click.option("--rounds", default=3, show_default=True, type=click.IntRange(min=2), help="Of turns.")
@click.option("--memory-frames", default=50, show_default=True, type=click.IntRange(min=1))
@click.option("--spp", default=64, show_default=True, help="Samples a pixel of the reference.")
@click.option("--threads", default=1, show_default=True, help="Of each path tracer.")
@click.option("--blenderproc", help="Python with BlenderProc, which becomes the reference.")
def main(
    scenario: str,
    frames: int,
    rounds: int,
    memory_frames: int,
    spp: int,
    threads: int,
    blenderproc: str | None,
) -> None:
    """Measure all installed renderers, with Cycles on the whole frame as the reference."""
    registry = load_plugins().registry
    checked = load_scenario(scenario, registry, {"renderer.name": "blender"})
    case = ScenarioCase(scenario, checked, "random", frames)
    camera = checked.camera.camera()
    click.echo(f"{scenario}, {frames} poses, {camera.width_px} x {camera.height_px} px; CPU-seconds")
    bench = Remote(case)
    labels: Cost = bench.ask("labels")
    bench.close()
    click.echo(f"labels of a frame: {labels.cpu_s:.2f}\n")
    bare = {"threads": threads, "spp": spp, "adaptive_threshold": 0.0}
    entries = [enter(case, "bare Cycles", "blender", bare)]
    for title, name, options in CANDIDATES:
        if name not in registry.names("renderer"):
            click.echo(f"{title} is not installed")
            continue
        if name in SAMPLED:
            options = {**options, "threads": threads}
        try:
            entries.append(enter(case, title, name, options))
        except click.ClickException as error:
            click.echo(f"{title}: {error}")
    for turn in range(rounds):
        for entry in entries:
            entry.take_turn(seed=turn)
    for entry in entries:
        entry.noise = entry.remote.ask("noise")
    reference = Reference("Cycles", entries[0].wholes, entries[0].noise)
    if blenderproc is not None:
        costs, noise = entries[0].remote.ask("blenderproc", blenderproc, spp, threads, range(rounds))
        reference = Reference("BlenderProc", costs, noise)
        cpu_s, wall_s = fmean(cost.cpu_s for cost in costs), fmean(cost.wall_s for cost in costs)
        click.echo(
            f"BlenderProc: noise {fmean(noise):.3f}, frame {cpu_s:.2f} ({wall_s:.2f} s of wall)\n"
        )
    click.echo(
        f"{'':<15}{'noise':>8}{'box':>8}{'whole':>8}{f'{reference.title} then':>18}{'ratio':>8}"
        f"{'box, wall s':>13}{'start':>8}{'MB, frame 5':>13}{f'frame {memory_frames}':>10}"
        "   ratio of each pose"
    )
    for entry in entries:
        _tell(entry, reference, labels, memory_frames)
        entry.remote.close()


def _tell(entry: Entry, reference: Reference, labels: Cost, memory_frames: int) -> None:
    """A line of the table. ``… then``: the cost of the reference's whole image at this renderer's
    noise; ``ratio``: that over box and labels, the geometric mean over the poses. A renderer without
    noise is compared at the reference's own."""
    noise = entry.noise if entry.sampled else reference.noise
    reference_s = [
        whole.cpu_s * (theirs / mine) ** 2
        for whole, theirs, mine in zip(reference.wholes, reference.noise, noise, strict=True)
    ]
    ratios = [
        cost_s / (box.cpu_s + labels.cpu_s) for cost_s, box in zip(reference_s, entry.boxes, strict=True)
    ]
    told = f"{fmean(noise):>8.3f}" if entry.sampled else f"{'-':>8}"
    memory_mb = entry.memory_mb(memory_frames)
    click.echo(
        f"{entry.title:<15}{told}{fmean(box.cpu_s for box in entry.boxes):>8.2f}"
        f"{fmean(whole.cpu_s for whole in entry.wholes):>8.2f}{fmean(reference_s):>18.2f}"
        f"{geometric_mean(ratios):>7.1f}x{fmean(box.wall_s for box in entry.boxes):>13.2f}"
        f"{entry.start.cpu_s:>8.1f}{memory_mb[0]:>13.0f}{memory_mb[1]:>10.0f}   "
        + " ".join(f"{ratio:.1f}" for ratio in ratios)
    )


if __name__ == "__main__":
    main()
