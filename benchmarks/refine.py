"""Measures what refinement makes of poses: from the shipped nets, and from starts that are off.

    posse run posse-aqua-earth --renderer mitsuba --out d --frames 30 -o camera.width_px=512 \\
      -o camera.height_px=384 -o 'annotators=[box,mask,keypoints,pose]' -o writers=[] \\
      -o 'propagator={name: roe}' \\
      -o 'relative={design: {name: algorithm-3-1-repaired, relative_orbits: 25, size_m: 12}}'
    python benchmarks/refine.py d                       # from the shipped nets
    python benchmarks/refine.py d --degrees 5 --share 0.02     # from the truth, so far off

Frames in eclipse, and those of which less than a tenth is lit or less than half is in view, are left
out.
The Sun's direction is the labels'; with --dark the refiner is not told.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._detection.evaluate import sun_direction_cam
from posse_core._detection.models import open_models
from posse_core._detection.pose_detector import PoseDetector
from posse_core._evaluation.poses import pose_errors
from posse_core._frames import (
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    unit,
)
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.label_line import LabelLine
from posse_core._plugins.loading import load_plugins
from posse_core._randomness import random_generator
from posse_core._refinement.opening import open_refiner
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.load import load_scenario
from posse_core._simulator.scene import scene_of


@dataclass(frozen=True)
class Row:
    """Errors of one frame: e_t and e_q (rad) before and after, and what the refiner says."""

    before: tuple[float, float]
    after: tuple[float, float]
    is_better: bool
    nees: float
    took_s: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("dataset", type=Path, nargs="+")
    parser.add_argument("--degrees", type=float, help="start so far from the true attitude")
    parser.add_argument("--share", type=float, default=0.02, help="and so far from the true range")
    parser.add_argument("--dark", action="store_true", help="do not tell where the Sun is")
    parser.add_argument("--ms", type=float, help="time for a pose")
    options = parser.parse_args()
    for folder in options.dataset:
        print(f"{folder}: {_summary(list(_rows(Dataset(folder), options)))}", flush=True)


def _rows(dataset: Dataset, options: argparse.Namespace) -> Iterator[Row]:
    registry = load_plugins().registry
    craft = scene_of(
        load_scenario(str(dataset.folder / "scenario.yaml"), registry, {}), registry
    ).spacecraft
    choice = ComponentChoice(
        name="render-compare", options={} if options.ms is None else {"ms": options.ms}
    )
    refiner = open_refiner(registry, choice, craft, dataset.camera)
    detector = PoseDetector(*open_models(None, None, registry, {}))
    for position, line in enumerate(dataset):
        is_lit = line.sun_fraction_target > 0 and (line.fraction_lit or 0) > 0.1
        if not is_lit or line.box_visible_px is None or (line.fraction_visible or 0) < 0.5:
            continue
        R, t = matrix_from_quaternion(np.array(line.q_cam_from_body)), np.array(line.t_body_cam_m)
        image = dataset.image(position)
        start = (
            detector.pose(image, dataset.camera)
            if options.degrees is None
            else _off(R, t, line, np.radians(options.degrees), options.share)
        )
        if start is None:
            continue
        began_s = time.perf_counter()
        made = refiner.refine(image, [start], None if options.dark else sun_direction_cam(line))
        took_s = time.perf_counter() - began_s
        off = np.concatenate(
            [
                rotation_vector_from_matrix(R @ made.pose.R_cam_from_body.T),
                t - made.pose.t_body_cam_m,
            ]
        )
        yield Row(
            pose_errors(R, t, start.R_cam_from_body, start.t_body_cam_m, craft.symmetries),
            pose_errors(R, t, made.pose.R_cam_from_body, made.pose.t_body_cam_m, craft.symmetries),
            made.is_better,
            float(off @ np.linalg.solve(made.pose.covariance, off)),
            took_s,
        )
    refiner.close()


def _off(R: np.ndarray, t: np.ndarray, line: LabelLine, angle_rad: float, share: float) -> PoseEstimate:
    """The truth, turned about a random axis, and nearer or farther."""
    draw = random_generator(0, line.index, "benchmark")
    turn = matrix_from_rotation_vector(angle_rad * unit(draw.standard_normal(3)))
    scale = 1 + share * draw.choice([-1.0, 1.0])
    return PoseEstimate(turn @ R, scale * t, np.eye(6), np.ones(4, np.bool_), 1.0)


def _summary(rows: list[Row]) -> str:
    before, after = np.array([r.before for r in rows]), np.array([r.after for r in rows])
    accepted = np.array([r.is_better for r in rows])
    worse = (after.sum(axis=1) > before.sum(axis=1))[accepted].mean() if accepted.any() else np.nan
    (e_t, e_q), (t90, q90) = np.median(after, axis=0), np.quantile(after, 0.9, axis=0)
    t0, q0 = np.median(before, axis=0)
    nees = np.median([r.nees for r in rows if r.is_better]) / 6 if accepted.any() else np.nan
    return (
        f"{len(rows)} frames, e_t {100 * t0:.2f} -> {100 * e_t:.2f} % (90th percentile {100 * t90:.2f}),"
        f" e_q {np.degrees(q0):.2f} -> {np.degrees(e_q):.2f}° ({np.degrees(q90):.2f}),"
        f" accepted {accepted.mean():.2f}, of these worse {worse:.2f}, NEES/6 median {nees:.1f},"
        f" {np.median([r.took_s for r in rows]):.1f} s a frame"
    )


if __name__ == "__main__":
    main()
