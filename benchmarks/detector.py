"""Milliseconds from an image to a pose: ``python benchmarks/detector.py DATASET`` prints a table.

The nets are those that come with posse-detect-onnx, or those named. Images are read beforehand; the
first few, which warm up caches, are left out.
"""

from __future__ import annotations

import time
from pathlib import Path

import click
import numpy as np

from posse_core.dataset import Dataset
from posse_core.detection.models import open_models
from posse_core.detection.pnp import solve_pose
from posse_core.plugins import load_plugins

WARM_UP = 5


@click.command()
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--model", type=click.Path(path_type=Path))
@click.option("--keypoints", type=click.Path(path_type=Path))
@click.option("--frames", default=60, show_default=True, type=click.IntRange(min=1))
@click.option("--threads", default=2, show_default=True, type=click.IntRange(min=1))
def main(dataset: Path, model: Path | None, keypoints: Path | None, frames: int, threads: int) -> None:
    """Time the way from an image of DATASET to a pose."""
    source = Dataset(dataset)
    detector, finder = open_models(model, keypoints, load_plugins().registry, {"threads": threads})
    if finder is None:
        raise click.UsageError("name --keypoints too, or neither")
    indices = source.frames.indices[: frames + WARM_UP]
    images = [source.image(int(index)) for index in indices]
    rows = []
    for image in images:
        clock = [time.perf_counter()]
        (found,) = detector.predict([image])
        clock.append(time.perf_counter())
        found = finder.find(image, found[:1])
        clock.append(time.perf_counter())
        for one in found:
            assert one.keypoints_px is not None
            assert one.keypoints_sigma_px is not None
            points = finder.keypoints_body_m[one.label]
            solve_pose(points, one.keypoints_px, one.keypoints_sigma_px, source.camera)
        clock.append(time.perf_counter())
        if found:
            rows.append([*np.diff(clock), clock[-1] - clock[0]])
    used = 1e3 * np.array(rows[WARM_UP:])
    click.echo(
        f"{len(used)} frames of {images[0].shape[1]} × {images[0].shape[0]}, {threads} threads, ms"
    )
    for name, column in zip(("box", "keypoints", "pose", "together"), used.T, strict=True):
        low, middle, high = np.percentile(column, [5, 50, 95])
        click.echo(f"{name:10} median {middle:.1f}, 5 … 95 % {low:.1f} … {high:.1f}")


if __name__ == "__main__":
    main()
