"""Measures of single frames, summed up over all frames of a case."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._evaluation.crosscheck.measures import (
    FrameMeasures,
    Pair,
    PairSummary,
    Ratios,
    RendererFrame,
    RendererSummary,
)
from posse_core._model.scene import Scene


@dataclass
class Sums:
    """Pixels of one renderer's silhouettes, summed over frames.

    Attributes:
        both_px, either_px: of the intersection and the union with the exact silhouettes.
        displaced_px: area between the two silhouettes' contours.
        contour_px: length of the exact contours.
    """

    both_px: int = 0
    either_px: int = 0
    displaced_px: float = 0.0
    contour_px: float = 0.0


def renderer_summary(frames: Sequence[RendererFrame], sums: Sums) -> RendererSummary:
    """Sum up the frames of one renderer; there must be one at least."""
    shifts_px = [abs(shift) for f in frames for shift in (f.shift_right_px, f.shift_down_px)]
    ratios = _known(f.expected_ratio for f in frames)
    return RendererSummary(
        frames=len(frames),
        iou=sums.both_px / max(sums.either_px, 1),
        iou_worst=min(f.iou for f in frames),
        iou_centres=_mean(f.iou_centres for f in frames),
        edge_px=sums.displaced_px / max(sums.contour_px, 1.0),
        edge_worst_px=max(f.edge_px for f in frames),
        shift_worst_px=max(shifts_px),
        growth_px=_mean(f.growth_px for f in frames),
        depth_median_m=_mean_known(f.depth_median_m for f in frames),
        depth_p99_m=_mean_known(f.depth_p99_m for f in frames),
        mean_radiance_w_m2_sr=_mean(f.mean_radiance_w_m2_sr for f in frames),
        expected_ratio=max(ratios, key=lambda ratio: abs(ratio - 1), default=None),
        expected_rms=_mean_known(f.expected_rms for f in frames),
        landmark_worst_px=max(_known(f.landmark_px for f in frames), default=None),
        noise=_mean_known(f.noise for f in frames),
        opening_s=frames[0].opening_s,
        first_frame_s=frames[0].seconds,
        frame_s=median(f.seconds for f in frames[1:] or frames),
    )


def pair_summary(pair: Pair, frames: Sequence[FrameMeasures]) -> PairSummary:
    """Sum up the frames that both renderers of a pair made; there must be one at least."""
    of_pair = [frame.pairs[pair] for frame in frames]
    ratios = _known(f.radiance_ratio for f in of_pair)
    first, second = _part_light(pair, frames)
    return PairSummary(
        iou=_mean(f.iou for f in of_pair),
        edge_px=_mean(f.edge_px for f in of_pair),
        radiance_ratio=_ratio(first.sum(), second.sum()),
        radiance_ratio_least=min(ratios, default=None),
        radiance_ratio_most=max(ratios, default=None),
        ssim=_mean(f.ssim for f in of_pair),
        ssim_worst=min(f.ssim for f in of_pair),
    )


def part_ratios(pair: Pair, frames: Sequence[FrameMeasures], scene: Scene) -> Ratios:
    """A pair's light by part; the parts of bodies beside the target have these bodies' names before
    theirs."""
    first, second = _part_light(pair, frames)
    names = [
        prefix + part.name
        for prefix, craft in zip(_prefixes(scene), scene.bodies, strict=True)
        for part in craft.parts
    ]
    return {name: _ratio(a, b) for name, a, b in zip(names, first, second, strict=True)}


def material_ratios(pair: Pair, frames: Sequence[FrameMeasures], scene: Scene) -> Ratios:
    """A pair's light by those materials that parts are of, named likewise."""
    first, second = _part_light(pair, frames)
    prefixes = _prefixes(scene)
    parts: dict[str, list[int]] = {}
    for index, (piece, body) in enumerate(zip(scene.pieces, scene.body_of_part, strict=True)):
        parts.setdefault(prefixes[body] + piece.part.material, []).append(index)
    return {name: _ratio(first[i].sum(), second[i].sum()) for name, i in parts.items()}


def _prefixes(scene: Scene) -> list[str]:
    """What the names of a body's parts begin with, by body."""
    return ["", *(f"{body.name}: " for body in scene.others)]


def _part_light(pair: Pair, frames: Sequence[FrameMeasures]) -> tuple[FloatArray, FloatArray]:
    """(P,) the light on each part over all frames, by the pair's first and second renderer."""
    first, second = (np.sum([f.part_light[name] for f in frames], axis=0) for name in pair)
    return first, second


def _ratio(a: float, b: float) -> float | None:
    return float(a / b) if b > 0 and a > 0 else None


def _known(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


def _mean_known(values: Iterable[float | None]) -> float | None:
    known = _known(values)
    return _mean(known) if known else None
