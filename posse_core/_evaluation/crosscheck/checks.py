"""Which differences are too large."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import Field

from posse_core._plugins.options import Options

if TYPE_CHECKING:
    from posse_core._evaluation.crosscheck.measures import Comparison


class Thresholds(Options):
    """The thresholds of a crosscheck. Path tracers are renderers with the capability ``path-traced``."""

    min_iou: float = Field(
        0.995, ge=0, le=1, description="Least IoU of silhouettes with exact geometry over all frames."
    )
    max_edge_px: float = Field(
        0.1, ge=0, description="Largest mean edge distance in any frame, pixels, for path tracers."
    )
    max_edge_other_px: float = Field(
        0.5, ge=0, description="Largest mean edge distance, pixels, for other renderers."
    )
    max_landmark_px: float = Field(
        0.1, ge=0, description="Largest distance of a plate's centroid from where it is, pixels."
    )
    max_lambert: float = Field(
        0.01, ge=0, description="Largest relative error of Lambertian radiance for path tracers."
    )
    max_lambert_other: float = Field(
        0.03, ge=0, description="Largest relative error of Lambertian radiance for other renderers."
    )
    max_mean: float = Field(
        0.05, ge=0, description="Largest relative difference of the mean radiance between path tracers."
    )


@dataclass(frozen=True)
class Verdict:
    """One threshold, held against one number."""

    case: str
    who: str
    what: str
    value: float
    limit: float
    passed: bool

    def __str__(self) -> str:
        return f"{self.case}: {self.who}: {self.what} is {self.value:.4g}, not within {self.limit:g}"


def judge(
    comparison: Comparison, thresholds: Thresholds, capabilities: Mapping[str, Iterable[str]]
) -> Iterator[Verdict]:
    """Hold a comparison against the thresholds; ``capabilities`` by renderer."""
    case = comparison.name
    traced = {name for name, words in capabilities.items() if "path-traced" in words}

    def at_most(who: str, what: str, value: float | None, limit: float) -> Iterator[Verdict]:
        if value is not None:
            yield Verdict(case, who, what, value, limit, value <= limit)

    for name, measured in comparison.renderers.items():
        limit = thresholds.min_iou
        yield Verdict(case, name, "silhouette IoU", measured.iou, limit, measured.iou >= limit)
        edge = thresholds.max_edge_px if name in traced else thresholds.max_edge_other_px
        yield from at_most(name, "edge distance (px)", measured.edge_worst_px, edge)
        landmark = measured.landmark_worst_px
        yield from at_most(name, "landmark distance (px)", landmark, thresholds.max_landmark_px)
        ratio = measured.expected_ratio
        if comparison.lambertian and ratio is not None:
            off = thresholds.max_lambert if name in traced else thresholds.max_lambert_other
            yield from at_most(name, "Lambertian radiance error", abs(ratio - 1), off)
    for pair, shared in comparison.pairs.items():
        ratio = shared.radiance_ratio
        if ratio is not None and traced.issuperset(pair):
            error = abs(ratio - 1)
            yield from at_most(str(pair), "mean radiance difference", error, thresholds.max_mean)
