"""The page of a crosscheck: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from markupsafe import Markup

from posse_core._evaluation.crosscheck.checks import Verdict
from posse_core._evaluation.crosscheck.compare import Comparison, FrameMeasures
from posse_core._evaluation.pages import heading, number, page, paragraph, strip, table

RENDERER_COLUMNS = {
    "frames": "frames",
    "iou": "IoU",
    "iou_worst": "IoU, worst frame",
    "edge_px": "edge, px",
    "edge_worst_px": "edge, worst frame, px",
    "shift_worst_px": "shift, worst, px",
    "growth_px": "growth, px",
    "landmark_worst_px": "landmark, worst, px",
    "depth_median_m": "depth, median, m",
    "depth_p99_m": "depth, 99 %, m",
    "mean_radiance_w_m2_sr": "mean radiance, W/m²/sr",
    "expected_ratio": "to closed form, worst",
    "expected_rms": "RMS to closed form",
    "noise": "noise",
    "opening_s": "opening, s",
    "first_frame_s": "first frame, s",
    "frame_s": "frame, s",
}
PAIR_COLUMNS = {
    "radiance_ratio": "radiance ratio",
    "radiance_ratio_least": "least",
    "radiance_ratio_most": "most",
    "ssim": "SSIM",
    "ssim_worst": "SSIM, worst frame",
    "iou": "IoU",
    "edge_px": "edge, px",
}


def make_page(comparisons: Sequence[Comparison], verdicts: Sequence[Verdict]) -> str:
    """HTML of all cases: verdicts, tables, and a strip of pictures a frame."""
    broken = [verdict for verdict in verdicts if not verdict.passed]
    summary = f"{len(verdicts) - len(broken)} of {len(verdicts)} thresholds hold."
    body = [_verdicts(verdicts), *(part for comparison in comparisons for part in _case(comparison))]
    title = "Crosscheck of " + ", ".join(comparison.name for comparison in comparisons)
    return page(title, summary, body)


def columns_in_use(
    rows: Iterable[Mapping[str, float | None]], columns: Mapping[str, str]
) -> dict[str, str]:
    """The columns that hold a number somewhere."""
    rows = list(rows)
    return {
        key: words for key, words in columns.items() if any(row.get(key) is not None for row in rows)
    }


def _verdicts(verdicts: Sequence[Verdict]) -> Markup:
    rows = [
        (v.case, v.who, v.what, number(v.value), number(v.limit), "holds" if v.passed else "broken")
        for v in verdicts
    ]
    broken = [place for place, verdict in enumerate(verdicts) if not verdict.passed]
    return table(("case", "who", "what", "value", "limit", ""), rows, broken)


def _case(comparison: Comparison) -> Iterator[Markup]:
    yield heading(comparison.name)
    for name, cause in comparison.failures.items():
        yield paragraph(f"{name} failed: {cause}", broken=True)
    for name, said in comparison.versions.items():
        words = ", ".join(f"{key} {value}" for key, value in said.items())
        yield paragraph(f"{name}: {words}")
    yield _numbers("renderer, against geometry", comparison.renderers, RENDERER_COLUMNS)
    if comparison.pairs:
        yield _numbers("pair", comparison.pairs, PAIR_COLUMNS)
        for what, ratios in (("material", comparison.materials), ("part", comparison.parts)):
            names = list(next(iter(ratios.values())))
            rows = [[name, *(number(ratios[pair][name]) for pair in ratios)] for name in names]
            yield table((f"radiance ratio by {what}", *ratios), rows)
    yield paragraph(
        "Pictures: each renderer, to the power 1/2.2, the brightest per cent white. Then light as a"
        " ratio: blue half, red twice, grey too dark to say. Then coverage minus the exact one: blue a"
        " quarter of a pixel too little, red too much."
    )
    yield from map(_strip, comparison.frames)


def _strip(frame: FrameMeasures) -> Markup:
    words = f"frame {frame.index}: {frame.range_m:.1f} m, phase {np.degrees(frame.phase_rad):.0f}°"
    ratios = [
        f"{pair} {number(v['radiance_ratio'])} (SSIM {number(v['ssim'])})"
        for pair, v in frame.pairs.items()
    ]
    return strip("; ".join([words, *ratios]), frame.pictures.captions, frame.pictures.jpegs)


def _numbers(
    title: str, rows: Mapping[str, Mapping[str, float | None]], columns: Mapping[str, str]
) -> Markup:
    used = columns_in_use(rows.values(), columns)
    cells = [[name, *(number(row.get(key)) for key in used)] for name, row in rows.items()]
    return table((title, *used.values()), cells)
