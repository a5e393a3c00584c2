"""Tables of a crosscheck, as the command prints them and its page shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from posse_core._evaluation.crosscheck.measures import Pair, PairSummary, Ratios, RendererSummary
from posse_core._evaluation.numbers import number

SummaryT = TypeVar("SummaryT")


@dataclass(frozen=True)
class Column(Generic[SummaryT]):
    """One measure of a summary, and its heading."""

    heading: str
    value: Callable[[SummaryT], float | None]


@dataclass(frozen=True)
class Table:
    """Cells as text, each row as long as the header."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


RENDERER_COLUMNS: tuple[Column[RendererSummary], ...] = (
    Column("frames", lambda of: of.frames),
    Column("IoU", lambda of: of.iou),
    Column("IoU, worst frame", lambda of: of.iou_worst),
    Column("edge, px", lambda of: of.edge_px),
    Column("edge, worst frame, px", lambda of: of.edge_worst_px),
    Column("shift, worst, px", lambda of: of.shift_worst_px),
    Column("growth, px", lambda of: of.growth_px),
    Column("landmark, worst, px", lambda of: of.landmark_worst_px),
    Column("depth, median, m", lambda of: of.depth_median_m),
    Column("depth, 99 %, m", lambda of: of.depth_p99_m),
    Column("mean radiance, W/m²/sr", lambda of: of.mean_radiance_w_m2_sr),
    Column("to closed form, worst", lambda of: of.expected_ratio),
    Column("RMS to closed form", lambda of: of.expected_rms),
    Column("noise", lambda of: of.noise),
    Column("opening, s", lambda of: of.opening_s),
    Column("first frame, s", lambda of: of.first_frame_s),
    Column("frame, s", lambda of: of.frame_s),
)
PAIR_COLUMNS: tuple[Column[PairSummary], ...] = (
    Column("radiance ratio", lambda of: of.radiance_ratio),
    Column("least", lambda of: of.radiance_ratio_least),
    Column("most", lambda of: of.radiance_ratio_most),
    Column("SSIM", lambda of: of.ssim),
    Column("SSIM, worst frame", lambda of: of.ssim_worst),
    Column("IoU", lambda of: of.iou),
    Column("edge, px", lambda of: of.edge_px),
)


def renderer_table(title: str, summaries: Mapping[str, RendererSummary]) -> Table:
    """A row for each renderer."""
    return _summary_table(title, summaries, RENDERER_COLUMNS)


def pair_table(title: str, summaries: Mapping[Pair, PairSummary]) -> Table:
    """A row for each pair."""
    by_name = {str(pair): summary for pair, summary in summaries.items()}
    return _summary_table(title, by_name, PAIR_COLUMNS)


def ratio_table(title: str, ratios: Mapping[Pair, Ratios]) -> Table:
    """A row for each part or material, and a column for each pair; there must be a pair."""
    names = next(iter(ratios.values()))
    rows = [[name, *(number(by_name[name]) for by_name in ratios.values())] for name in names]
    return Table((title, *map(str, ratios)), rows)


def _summary_table(
    title: str, summaries: Mapping[str, SummaryT], columns: Sequence[Column[SummaryT]]
) -> Table:
    """The columns that hold a number somewhere."""
    used = [
        column
        for column in columns
        if any(column.value(summary) is not None for summary in summaries.values())
    ]
    rows = [
        [name, *(number(column.value(summary)) for column in used)]
        for name, summary in summaries.items()
    ]
    return Table((title, *(column.heading for column in used)), rows)
