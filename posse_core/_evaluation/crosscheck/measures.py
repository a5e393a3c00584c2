"""What a crosscheck measures of renderers and of pairs of them, frame by frame and over all frames.

docs/crosscheck.md says what the measures mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, NamedTuple

from posse_core._arrays import FloatArray
from posse_core._evaluation.crosscheck.pictures import FramePictures

Ratios = Mapping[str, float | None]
"""Part or material → the light of a pair's first renderer over that of its second; None where either
is black."""


class Pair(NamedTuple):
    """Two renderers by name; every ratio is the first's over the second's."""

    first: str
    second: str

    def __str__(self) -> str:
        return f"{self.first} / {self.second}"


@dataclass(frozen=True)
class RendererFrame:
    """A renderer's picture of one frame, against exact geometry and closed forms.

    Attributes:
        iou: of the pixels with coverage ≥ ½ with those whose exact coverage is ≥ ½.
        iou_centres: of the same with the pixels whose centre is on the craft.
        edge_px: mean distance between the two silhouettes' edges, px.
        shift_right_px, shift_down_px, growth_px: displacement and growth of the silhouette, px.
        mean_radiance_w_m2_sr: all light, bands summed, over the exact area in pixels.
        seconds: that rendering took.
        opening_s: that opening the renderer took, in the first frame of its worker; else None.
        depth_median_m, depth_p99_m: median and 99 % quantile of the absolute difference of depth, m.
        expected_ratio: radiance over its closed form, in the band that is farthest from it.
        expected_rms: root mean square difference from the closed form over the form's mean.
        landmark_px: greatest distance of a part's centroid from where it is in closed form, px.
        noise: standard deviation of a pixel's radiance between seeds over the craft's mean radiance.
    """

    iou: float
    iou_centres: float
    edge_px: float
    shift_right_px: float
    shift_down_px: float
    growth_px: float
    mean_radiance_w_m2_sr: float
    seconds: float
    opening_s: float | None
    depth_median_m: float | None = None
    depth_p99_m: float | None = None
    expected_ratio: float | None = None
    expected_rms: float | None = None
    landmark_px: float | None = None
    noise: float | None = None

    def as_json(self) -> dict[str, Any]:
        """By field; a measure that not every renderer, case or frame has is left out if it is None."""
        optional = {field.name for field in fields(self) if field.default is not MISSING}
        return {
            name: value
            for name, value in vars(self).items()
            if value is not None or name not in optional
        }


@dataclass(frozen=True)
class PairFrame:
    """Two renderers' pictures of one frame, against each other.

    Attributes:
        iou: of the pixels with coverage ≥ ½.
        edge_px: mean distance between the two silhouettes' edges, px.
        radiance_ratio: of all light; None where the second picture is black.
        ssim: structural similarity over the craft, 0 … 1 or a little below 0.
    """

    iou: float
    edge_px: float
    radiance_ratio: float | None
    ssim: float


@dataclass(frozen=True)
class FrameMeasures:
    """One frame.

    Attributes:
        renderers, pairs: of those that rendered it.
        part_light: renderer → (P,) sum of radiance over bands and over the pixels of each part,
            W m⁻² sr⁻¹.
    """

    index: int
    range_m: float
    phase_rad: float
    renderers: Mapping[str, RendererFrame]
    pairs: Mapping[Pair, PairFrame]
    part_light: Mapping[str, FloatArray]
    pictures: FramePictures

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return {
            "index": self.index,
            "range_m": self.range_m,
            "phase_rad": self.phase_rad,
            "renderers": {name: measures.as_json() for name, measures in self.renderers.items()},
            "pairs": {str(pair): vars(measures) for pair, measures in self.pairs.items()},
        }


@dataclass(frozen=True)
class RendererSummary:
    """A renderer over all frames that it rendered; a measure that no frame has is None.

    Attributes:
        frames: how many.
        iou: of all frames' pixels together; ``iou_worst`` is that of the worst frame.
        iou_centres, growth_px, depth_median_m, depth_p99_m, mean_radiance_w_m2_sr, expected_rms, noise:
            means of what :class:`RendererFrame` has under the same name.
        edge_px: of all frames' contours together; ``edge_worst_px`` is that of the worst frame.
        shift_worst_px: greatest displacement to a side, up or down.
        expected_ratio: the frame's that is farthest from 1.
        landmark_worst_px: the worst frame's.
        opening_s, first_frame_s: seconds of opening the renderer, and of the first frame.
        frame_s: median of the seconds of the other frames.
    """

    frames: int
    iou: float
    iou_worst: float
    iou_centres: float
    edge_px: float
    edge_worst_px: float
    shift_worst_px: float
    growth_px: float
    depth_median_m: float | None
    depth_p99_m: float | None
    mean_radiance_w_m2_sr: float
    expected_ratio: float | None
    expected_rms: float | None
    landmark_worst_px: float | None
    noise: float | None
    opening_s: float | None
    first_frame_s: float
    frame_s: float


@dataclass(frozen=True)
class PairSummary:
    """Two renderers over all frames that both rendered.

    Attributes:
        iou, edge_px, ssim: means of what :class:`PairFrame` has under the same name.
        radiance_ratio: of the light on parts of all frames together; None where either is black.
        radiance_ratio_least, radiance_ratio_most: over frames; None where no frame has one.
        ssim_worst: of the worst frame.
    """

    iou: float
    edge_px: float
    radiance_ratio: float | None
    radiance_ratio_least: float | None
    radiance_ratio_most: float | None
    ssim: float
    ssim_worst: float


@dataclass(frozen=True)
class Comparison:
    """One case.

    Attributes:
        lambertian: see :class:`posse_core._evaluation.crosscheck.settings.Setting`.
        parts, materials: the light of each pair by part and by material.
        failures: renderer → what it failed with.
        versions: renderer → what it says of itself.
    """

    name: str
    lambertian: bool
    frames: list[FrameMeasures]
    renderers: Mapping[str, RendererSummary]
    pairs: Mapping[Pair, PairSummary]
    parts: Mapping[Pair, Ratios]
    materials: Mapping[Pair, Ratios]
    failures: Mapping[str, str]
    versions: Mapping[str, Mapping[str, str]]

    def as_json(self) -> dict[str, Any]:
        """For a program to read."""
        return {
            "name": self.name,
            "renderers": {name: vars(summary) for name, summary in self.renderers.items()},
            "pairs": {str(pair): vars(summary) for pair, summary in self.pairs.items()},
            "parts": {str(pair): ratios for pair, ratios in self.parts.items()},
            "materials": {str(pair): ratios for pair, ratios in self.materials.items()},
            "failures": self.failures,
            "versions": {name: dict(said) for name, said in self.versions.items()},
            "frames": [frame.as_json() for frame in self.frames],
        }
