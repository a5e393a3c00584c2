"""The cost of a run's bookkeeping: ``python benchmarks/bookkeeping.py --frames 100000``.

The run is real, with worker processes, but a frame is two small files and invented labels of the usual
length, without geometry and renderer. The script prints frames per second for each tenth of the run, the
peak memory of the main process, and the time that a resumed run takes to find the finished frames.
"""

from __future__ import annotations

import hashlib
import platform
import resource
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import numpy as np

from posse_core._files.atomic import write_bytes
from posse_core._interfaces.executor import FrameMade, FrameResult, FrameWorker
from posse_core._model.label_line import Box, Keypoint, LabelLine
from posse_core._model.run_lengths import RunLengths
from posse_core._plugins.loading import load_plugins
from posse_core._run.attempts import PoolOptions
from posse_core._run.local import LocalExecutor
from posse_core._run.plan import make_plan
from posse_core._run.run import run
from posse_core._scenario.load import load_scenario

TENTHS = 10


class NullWorker:
    """Writes a frame's files and returns its labels, all with invented content."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def make(self, index: int) -> FrameMade:
        image, truth = f"images/{index:06d}.png", f"truth/{index:06d}.npz"
        files = {image: b"image of frame %d" % index, truth: b"truth of frame %d" % index}
        for name, data in files.items():
            write_bytes(self._folder / name, data)
        labels = LabelLine(
            index=index,
            t_s=10.0 * index,
            epoch_utc="2022-01-31T02:02:27.580416",
            sequence=0,
            spacecraft="cubesat",
            sun_fraction_target=1.0,
            sun_fraction_camera=1.0,
            solar_flux_w_m2=1361.0,
            image=image,
            truth=truth,
            box_visible_px=Box(100, 200, 300, 400),
            mask_rle=RunLengths(size=(960, 1280), counts="0O1N2" * 400),
            mask_area_px=40912,
            part_area_px={f"part_{i}": 1000 + i for i in range(50)},
            keypoints={f"K{i}": Keypoint(640.123456789 + i, 480.987654321 - i, 2) for i in range(20)},
            q_cam_from_body=(1.0, 0.0, 0.0, 0.0),
            t_body_cam_m=(0.0, 0.0, 30.0),
            range_m=30.0,
        )
        digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
        return FrameMade(labels, digests)

    def close(self) -> None:
        """Nothing to free."""


class NullExecutor(LocalExecutor):
    """The usual pool of processes with a different worker."""

    def __init__(self, options: PoolOptions, folder: Path) -> None:
        super().__init__(options)
        self._folder = folder

    def run(
        self, make_worker: Callable[[], FrameWorker[Any]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Any]]:
        return super().run(partial(NullWorker, self._folder), indices)


class Clock:
    """Records wall-clock and processor time of this process when each tenth of the frames has
    arrived."""

    def __init__(self) -> None:
        self.ticks: list[tuple[float, float]] = []

    def _tick(self) -> None:
        self.ticks.append((time.monotonic(), time.process_time()))

    def progress(
        self, results: Iterable[FrameResult[FrameMade]], frames: int, done: int
    ) -> Iterator[FrameResult[FrameMade]]:
        for number, result in enumerate(results):
            if number % (frames // TENTHS) == 0:
                self._tick()
            yield result
        self._tick()


@click.command()
@click.option("--frames", type=click.IntRange(min=10), default=5000, show_default=True)
@click.option("--workers", type=click.IntRange(min=1), default=1, show_default=True)
def main(frames: int, workers: int) -> None:
    """Make a dataset of invented frames, and resume it."""
    plugins = load_plugins()
    changes = {"target.name": "cubesat", "times.count": frames, "writers": ["speed"]}
    plan = make_plan(load_scenario("aqua", plugins.registry, changes), plugins.registry)
    click.echo(f"{platform.processor() or platform.machine()}, {frames} frames, {workers} workers")
    click.echo(f"planning: peak memory {_peak_mib():.0f} MiB")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "dataset"
        executor = NullExecutor(PoolOptions(workers=workers), folder)
        clock = Clock()
        start = time.monotonic()
        result = run(plan, str(folder), plugins, executor, resume=False, progress=clock.progress)
        end = time.monotonic()
        assert result.made == frames
        spans = [np.subtract(b, a) for a, b in pairwise(clock.ticks)]
        rates = [frames / TENTHS / wall_s for wall_s, _ in spans]
        cpu_ms = [1e3 * cpu_s / (frames / TENTHS) for _, cpu_s in spans]
        click.echo(f"frames a second by tenths: {' '.join(f'{rate:.0f}' for rate in rates)}")
        click.echo(f"ms of processor a frame:   {' '.join(f'{ms:.2f}' for ms in cpu_ms)}")
        click.echo(f"last tenth over first: {rates[-1] / rates[0]:.3f}, {cpu_ms[-1] / cpu_ms[0]:.3f}")
        before_s, after_s = clock.ticks[0][0] - start, end - clock.ticks[-1][0]
        click.echo(f"before the first frame {before_s:.1f} s, after the last {after_s:.1f} s")
        click.echo(f"peak memory {_peak_mib():.0f} MiB")
        start, start_cpu = time.monotonic(), time.process_time()
        again = run(plan, str(folder), plugins, executor, resume=True, progress=clock.progress)
        assert again.made == 0
        cpu_s = time.process_time() - start_cpu
        click.echo(f"resume scan {time.monotonic() - start:.2f} s, of which {cpu_s:.2f} s of processor")
        click.echo(f"peak memory {_peak_mib():.0f} MiB")


def _peak_mib() -> float:
    """Peak memory of this process in MiB, without its workers."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
