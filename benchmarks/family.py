"""Proves datasets of the family: ``python benchmarks/family.py 0 200`` makes and validates 200.

Each is of another seed and has two small frames by the raster renderer, with every label. What is
printed are the seeds that have faults, and the number of those that have none.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import click
import numpy as np

import posse_core
from posse_core._evaluation.validate import validate
from posse_core._randomness import random_generator


@click.command()
@click.argument("first", type=int)
@click.argument("count", type=int)
@click.option("--damage", is_flag=True, help="Damage every craft.")
def main(first: int, count: int, damage: bool) -> None:
    """Make and validate the datasets of COUNT craft from the seed FIRST on."""
    start_s, sound = time.perf_counter(), 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            faults = faults_of(seed, Path(folder) / str(seed), damage)
            sound += not faults
            for fault in faults:
                click.echo(f"seed {seed}: {fault}")
    click.echo(f"{sound} of {count} without a fault, {time.perf_counter() - start_s:.0f} s")


def faults_of(seed: int, folder: Path, damage: bool) -> list[str]:
    """The faults that validation finds in a dataset of the seed."""
    rng = random_generator(seed, -1, "place")
    direction = rng.standard_normal(3)
    position_m = 25.0 * direction / np.linalg.norm(direction)
    changes = {
        "target": {"name": "family", "seed": seed},
        "relative": {"state_rtn": {"r_m": position_m.tolist(), "v_m_s": [0.0, 0.0, 0.0]}},
        "times": {"t_s": [900.0, 1100.0]},
        "camera": {"width_px": 160, "height_px": 120, "hfov_deg": 40},
        "sky": {"earth": False},
        "renderer": {"name": "raster"},
        "annotators": ["albedo", "box", "depth", "keypoints", "mask", "normals", "parts", "pose"],
        "seed": seed,
    }
    if damage:
        changes["damage"] = {"missing_parts": 2, "torn_parts": 3, "bent_parts": 2}
    dataset = posse_core.run("aqua", folder, overrides=changes)
    report = validate(dataset, lambda positions, _: positions)
    return [f"{result.name}: {fault.message}" for result in report.results for fault in result.faults]


if __name__ == "__main__":
    main()
