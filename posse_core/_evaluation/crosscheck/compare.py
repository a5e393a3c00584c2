"""A case rendered by each renderer, measured frame by frame, and summed up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import ComponentError
from posse_core._evaluation.crosscheck import light, silhouette
from posse_core._evaluation.crosscheck.pictures import FramePictures
from posse_core._evaluation.crosscheck.settings import Case, Setting
from posse_core._evaluation.crosscheck.shots import NOISE_FRAMES, Shot, Taken, load_shot, shoot
from posse_core._evaluation.crosscheck.silhouette import Exact, Geometry
from posse_core._interfaces.executor import Executor, FrameResult
from posse_core._model.scene import FrameState
from posse_core._scenario.component import ComponentChoice

Progress = Callable[[Iterable[FrameResult[Taken]], int, str], Iterable[FrameResult[Taken]]]
"""Wraps the pictures of one renderer to show how far it is: (results, how many, words)."""
Values = dict[str, float | None]


@dataclass(frozen=True)
class FrameMeasures:
    """One frame.

    Attributes:
        renderers: renderer → its numbers by name; docs/crosscheck.md says what each is.
        pairs: ``"a / b"`` → the same.
        part_light: renderer → (P,) sum of radiance over the pixels of each part.
    """

    index: int
    range_m: float
    phase_rad: float
    renderers: Mapping[str, Values]
    pairs: Mapping[str, Values]
    part_light: Mapping[str, FloatArray]
    pictures: FramePictures


@dataclass
class Comparison:
    """One case.

    Attributes:
        renderers: by name: its numbers over all frames.
        pairs: ``"a / b"``: the same; ratios are a over b.
        parts, materials: pair → part or material → ratio of light, None where either is black.
        failures: renderer → what it failed with.
        versions: renderer → what it says of itself.
    """

    name: str
    lambertian: bool
    frames: list[FrameMeasures] = field(default_factory=list)
    renderers: dict[str, Values] = field(default_factory=dict)
    pairs: dict[str, Values] = field(default_factory=dict)
    parts: dict[str, Values] = field(default_factory=dict)
    materials: dict[str, Values] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    versions: dict[str, Mapping[str, str]] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return {
            "name": self.name,
            "renderers": self.renderers,
            "pairs": self.pairs,
            "parts": self.parts,
            "materials": self.materials,
            "failures": self.failures,
            "versions": {name: dict(said) for name, said in self.versions.items()},
            "frames": [
                {
                    "index": frame.index,
                    "range_m": frame.range_m,
                    "phase_rad": frame.phase_rad,
                    "renderers": frame.renderers,
                    "pairs": frame.pairs,
                }
                for frame in self.frames
            ],
        }


@dataclass
class _Sums:
    """Of one renderer, over frames."""

    both_px: int = 0
    either_px: int = 0
    displaced_px: float = 0.0
    contour_px: float = 0.0


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
    result = Comparison(case.name, setting.lambertian)
    said: dict[str, dict[int, Taken]] = {}
    for name, choice in choices.items():
        said[name] = {}
        jobs = seen + second
        try:
            done = shoot(case, choice, folder / name, executor, jobs)
            for job in progress(done, len(jobs), f"{case.name}: {name}"):
                if job.made is None:
                    result.failures.setdefault(name, f"frame {job.index}: {job.error}")
                else:
                    said[name][job.index] = job.made
                    result.versions[name] = job.made.describe
        except ComponentError as error:
            result.failures[name] = str(error)
    sums = {name: _Sums() for name in choices}
    for i in seen:
        shots_by_name = {n: load_shot(folder / n, i, s[i]) for n, s in said.items() if i in s}
        if not shots_by_name:
            continue
        exact = geometry.exact(setting.frames[i])
        frame = _measure(setting, setting.frames[i], exact, shots_by_name, sums)
        for name, shot in shots_by_name.items():
            twin = i + len(setting.frames)
            if twin in said[name]:
                other = load_shot(folder / name, twin, said[name][twin])
                covered = exact.coverage > 0
                frame.renderers[name]["noise"] = light.noise(
                    shot.radiance_rgb, other.radiance_rgb, covered
                )
        result.frames.append(frame)
    _sum_up(result, setting, sums)
    return result


def _measure(
    setting: Setting,
    frame: FrameState,
    exact: Exact,
    shots: Mapping[str, Shot],
    sums: Mapping[str, _Sums],
) -> FrameMeasures:
    inside = exact.coverage >= 0.5
    expected = setting.expected_rgb(frame)
    landmarks = setting.landmarks_px(frame)
    renderers: dict[str, Values] = {}
    for name, shot in shots.items():
        seen, own = shot.coverage >= 0.5, sums[name]
        own.both_px += int((seen & inside).sum())
        own.either_px += int((seen | inside).sum())
        own.displaced_px += float(np.abs(shot.coverage - exact.coverage).sum())
        own.contour_px += exact.contour_px
        right, down, outward = silhouette.edge_shift_px(shot.coverage, exact.coverage).tolist()
        values: Values = {
            "iou": silhouette.iou(seen, inside),
            "iou_centres": silhouette.iou(seen, exact.part_id >= 0),
            "edge_px": silhouette.edge_distance_px(shot.coverage, exact.coverage, exact.contour_px),
            "shift_right_px": right,
            "shift_down_px": down,
            "growth_px": outward,
            "mean_radiance_w_m2_sr": float(shot.radiance_rgb.sum() / exact.coverage.sum()),
            "seconds": shot.seconds,
            "opening_s": shot.opening_s,
        }
        if shot.depth_m is not None:
            error_m = np.abs(shot.depth_m.astype(np.float64) - exact.depth_m)
            error_m = error_m[np.isfinite(error_m)]
            values["depth_median_m"] = float(np.median(error_m))
            values["depth_p99_m"] = float(np.quantile(error_m, 0.99))
        if expected is not None:
            values["expected_ratio"], values["expected_rms"] = light.agreement(
                shot.radiance_rgb, expected[exact.box.slices], exact.coverage == 1
            )
        if landmarks is not None:
            errors_px = silhouette.landmark_errors_px(shot.coverage, exact, landmarks)
            values["landmark_px"] = float(errors_px.max())
        renderers[name] = values
    white = light.full_scale(next(iter(shots.values())).radiance_rgb, inside)
    pairs = {f"{a} / {b}": _pair(shots[a], shots[b], exact, white) for a, b in combinations(shots, 2)}
    parts = len(setting.scene.spacecraft.parts)
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


def _pair(a: Shot, b: Shot, exact: Exact, white: float) -> Values:
    light_a, light_b = float(a.radiance_rgb.sum()), float(b.radiance_rgb.sum())
    shown = [light.displayed(shot.radiance_rgb.mean(axis=-1), white) for shot in (a, b)]
    return {
        "iou": silhouette.iou(a.coverage >= 0.5, b.coverage >= 0.5),
        "edge_px": silhouette.edge_distance_px(a.coverage, b.coverage, exact.contour_px),
        "radiance_ratio": light_a / light_b if light_b > 0 else None,
        "ssim": light.structural_similarity(shown[0], shown[1], exact.coverage > 0),
    }


def _sum_up(result: Comparison, setting: Setting, sums: Mapping[str, _Sums]) -> None:
    craft = setting.scene.spacecraft
    part_names = [part.name for part in craft.parts]
    for name, own in sums.items():
        frames = [frame.renderers[name] for frame in result.frames if name in frame.renderers]
        if not frames:
            continue
        result.renderers[name] = {
            "frames": len(frames),
            "iou": own.both_px / max(own.either_px, 1),
            "iou_worst": _least(frames, "iou"),
            "iou_centres": _mean(frames, "iou_centres"),
            "edge_px": own.displaced_px / max(own.contour_px, 1.0),
            "edge_worst_px": _most(frames, "edge_px"),
            "shift_worst_px": max(_most(frames, "shift_right_px"), _most(frames, "shift_down_px")),
            "growth_px": _mean(frames, "growth_px"),
            "depth_median_m": _mean(frames, "depth_median_m"),
            "depth_p99_m": _mean(frames, "depth_p99_m"),
            "mean_radiance_w_m2_sr": _mean(frames, "mean_radiance_w_m2_sr"),
            "expected_ratio": _farthest(frames, "expected_ratio"),
            "expected_rms": _mean(frames, "expected_rms"),
            "landmark_worst_px": _most(frames, "landmark_px") if "landmark_px" in frames[0] else None,
            "noise": _mean(frames, "noise"),
            "opening_s": frames[0]["opening_s"],
            "first_frame_s": frames[0]["seconds"],
            "frame_s": median(f["seconds"] or 0.0 for f in frames[1:] or frames),
        }
    for a, b in combinations(result.renderers, 2):
        pair = f"{a} / {b}"
        shared = [frame for frame in result.frames if pair in frame.pairs]
        if not shared:
            continue
        values = [frame.pairs[pair] for frame in shared]
        light_a, light_b = (np.sum([f.part_light[name] for f in shared], axis=0) for name in (a, b))
        ratios = [value["radiance_ratio"] for value in values]
        result.pairs[pair] = {
            "iou": _mean(values, "iou"),
            "edge_px": _mean(values, "edge_px"),
            "radiance_ratio": _ratio(light_a.sum(), light_b.sum()),
            "radiance_ratio_least": min((r for r in ratios if r is not None), default=None),
            "radiance_ratio_most": max((r for r in ratios if r is not None), default=None),
            "ssim": _mean(values, "ssim"),
            "ssim_worst": _least(values, "ssim"),
        }
        result.parts[pair] = {
            name: _ratio(x, y) for name, x, y in zip(part_names, light_a, light_b, strict=True)
        }
        result.materials[pair] = {}
        for material in craft.materials:
            of_it = [i for i, part in enumerate(craft.parts) if part.material == material]
            if of_it:
                result.materials[pair][material] = _ratio(light_a[of_it].sum(), light_b[of_it].sum())


def _ratio(a: float, b: float) -> float | None:
    return float(a / b) if b > 0 and a > 0 else None


def _known(values: Iterable[Mapping[str, float | None]], key: str) -> list[float]:
    return [value for one in values if (value := one.get(key)) is not None]


def _mean(values: Iterable[Mapping[str, float | None]], key: str) -> float | None:
    known = _known(values, key)
    return float(np.mean(known)) if known else None


def _least(values: Iterable[Mapping[str, float | None]], key: str) -> float:
    return min(_known(values, key))


def _most(values: Iterable[Mapping[str, float | None]], key: str) -> float:
    return max(map(abs, _known(values, key)))


def _farthest(values: Iterable[Mapping[str, float | None]], key: str) -> float | None:
    """The ratio that is farthest from 1."""
    known = _known(values, key)
    return max(known, key=lambda ratio: abs(ratio - 1)) if known else None
