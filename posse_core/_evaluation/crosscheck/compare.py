"""A case rendered by each renderer, and measured frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import combinations
from pathlib import Path

import numpy as np

from posse_core._errors import ComponentError
from posse_core._evaluation.crosscheck import light, silhouette
from posse_core._evaluation.crosscheck.measures import (
    Comparison,
    FrameMeasures,
    Pair,
    PairFrame,
    RendererFrame,
)
from posse_core._evaluation.crosscheck.pictures import FramePictures
from posse_core._evaluation.crosscheck.settings import Case, Setting
from posse_core._evaluation.crosscheck.shots import NOISE_FRAMES, Shot, Taken, load_shot, shoot
from posse_core._evaluation.crosscheck.silhouette import Exact, Geometry
from posse_core._evaluation.crosscheck.summary import (
    Sums,
    material_ratios,
    pair_summary,
    part_ratios,
    renderer_summary,
)
from posse_core._interfaces.executor import Executor, FrameResult
from posse_core._model.scene import FrameState
from posse_core._scenario.component import ComponentChoice

Progress = Callable[[Iterable[FrameResult[Taken]], int, str], Iterable[FrameResult[Taken]]]
"""Wraps the pictures of one renderer to show how far it is: (results, how many, words)."""


def compare(
    case: Case,
    choices: Mapping[str, ComponentChoice],
    folder: Path,
    executor: Executor,
    progress: Progress,
) -> Comparison:
    """Render a case by every renderer, one after the other, and measure.

    Args:
        choices: name → renderer with its options.
        folder: for the pictures until they are measured.
    """
    setting = case.build()
    geometry = Geometry(setting.scene)
    seen = [i for i, frame in enumerate(setting.frames) if not geometry.box(frame).is_empty]
    second = [len(setting.frames) + i for i in seen[:NOISE_FRAMES]]
    failures: dict[str, str] = {}
    versions: dict[str, Mapping[str, str]] = {}
    said: dict[str, dict[int, Taken]] = {}
    for name, choice in choices.items():
        said[name] = {}
        jobs = seen + second
        try:
            done = shoot(case, choice, folder / name, executor, jobs)
            for job in progress(done, len(jobs), f"{case.name}: {name}"):
                if job.made is None:
                    failures.setdefault(name, f"frame {job.index}: {job.error}")
                else:
                    said[name][job.index] = job.made
                    versions[name] = job.made.describe
        except ComponentError as error:
            failures[name] = str(error)
    sums = {name: Sums() for name in choices}
    frames = []
    for i in seen:
        shots = {name: load_shot(folder / name, i, by[i]) for name, by in said.items() if i in by}
        if not shots:
            continue
        twin = i + len(setting.frames)
        twins = {
            name: load_shot(folder / name, twin, said[name][twin])
            for name in shots
            if twin in said[name]
        }
        exact = geometry.exact(setting.frames[i])
        frames.append(_measure(setting, setting.frames[i], exact, shots, twins, sums))
    renderers = {
        name: renderer_summary([f.renderers[name] for f in frames if name in f.renderers], own)
        for name, own in sums.items()
        if any(name in f.renderers for f in frames)
    }
    shared = {
        Pair(a, b): [f for f in frames if (a, b) in f.pairs] for a, b in combinations(renderers, 2)
    }
    shared = {pair: of_pair for pair, of_pair in shared.items() if of_pair}
    return Comparison(
        case.name,
        setting.lambertian,
        frames,
        renderers,
        pairs={pair: pair_summary(pair, of_pair) for pair, of_pair in shared.items()},
        parts={pair: part_ratios(pair, of_pair, setting.scene) for pair, of_pair in shared.items()},
        materials={
            pair: material_ratios(pair, of_pair, setting.scene) for pair, of_pair in shared.items()
        },
        failures=failures,
        versions=versions,
    )


def _measure(
    setting: Setting,
    frame: FrameState,
    exact: Exact,
    shots: Mapping[str, Shot],
    twins: Mapping[str, Shot],
    sums: Mapping[str, Sums],
) -> FrameMeasures:
    """Measure one frame and add it to the sums; ``twins`` are the same pictures with another seed."""
    inside = exact.coverage >= 0.5
    expected = setting.expected_rgb(frame)
    landmarks = setting.landmarks_px(frame)
    renderers = {}
    for name, shot in shots.items():
        seen, own = shot.coverage >= 0.5, sums[name]
        own.both_px += int((seen & inside).sum())
        own.either_px += int((seen | inside).sum())
        own.displaced_px += float(np.abs(shot.coverage - exact.coverage).sum())
        own.contour_px += exact.contour_px
        right, down, outward = silhouette.edge_shift_px(shot.coverage, exact.coverage).tolist()
        depth_median_m = depth_p99_m = expected_ratio = expected_rms = landmark_px = noise = None
        if shot.depth_m is not None:
            error_m = np.abs(shot.depth_m.astype(np.float64) - exact.depth_m)
            error_m = error_m[np.isfinite(error_m)]
            depth_median_m = float(np.median(error_m))
            depth_p99_m = float(np.quantile(error_m, 0.99))
        if expected is not None:
            expected_ratio, expected_rms = light.agreement(
                shot.radiance_rgb, expected[exact.box.slices], exact.coverage == 1
            )
        if landmarks is not None:
            errors_px = silhouette.landmark_errors_px(shot.coverage, exact, landmarks)
            landmark_px = float(errors_px.max())
        if name in twins:
            noise = light.noise(shot.radiance_rgb, twins[name].radiance_rgb, exact.coverage > 0)
        renderers[name] = RendererFrame(
            iou=silhouette.iou(seen, inside),
            iou_centres=silhouette.iou(seen, exact.part_id >= 0),
            edge_px=silhouette.edge_distance_px(shot.coverage, exact.coverage, exact.contour_px),
            shift_right_px=right,
            shift_down_px=down,
            growth_px=outward,
            mean_radiance_w_m2_sr=float(shot.radiance_rgb.sum() / exact.coverage.sum()),
            seconds=shot.seconds,
            opening_s=shot.opening_s,
            depth_median_m=depth_median_m,
            depth_p99_m=depth_p99_m,
            expected_ratio=expected_ratio,
            expected_rms=expected_rms,
            landmark_px=landmark_px,
            noise=noise,
        )
    white = light.full_scale(next(iter(shots.values())).radiance_rgb, inside)
    pairs = {Pair(a, b): _pair(shots[a], shots[b], exact, white) for a, b in combinations(shots, 2)}
    parts = len(setting.scene.pieces)
    part_light = {n: light.part_light(s.radiance_rgb, exact.part_id, parts) for n, s in shots.items()}
    pictures = FramePictures.of(exact, shots, white)
    phase = float(
        np.arccos(
            np.clip(
                -frame.craft.sun_direction_cam @ frame.craft.t_body_cam_m / frame.craft.range_m, -1, 1
            )
        )
    )
    return FrameMeasures(frame.index, frame.craft.range_m, phase, renderers, pairs, part_light, pictures)


def _pair(a: Shot, b: Shot, exact: Exact, white: float) -> PairFrame:
    light_a, light_b = float(a.radiance_rgb.sum()), float(b.radiance_rgb.sum())
    shown = [light.displayed(shot.radiance_rgb.mean(axis=-1), white) for shot in (a, b)]
    return PairFrame(
        iou=silhouette.iou(a.coverage >= 0.5, b.coverage >= 0.5),
        edge_px=silhouette.edge_distance_px(a.coverage, b.coverage, exact.contour_px),
        radiance_ratio=light_a / light_b if light_b > 0 else None,
        ssim=light.structural_similarity(shown[0], shown[1], exact.coverage > 0),
    )
