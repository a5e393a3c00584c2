"""The page of a crosscheck: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from markupsafe import Markup

from posse_core._evaluation.crosscheck.checks import Verdict
from posse_core._evaluation.crosscheck.measures import Comparison, FrameMeasures
from posse_core._evaluation.crosscheck.tables import Table, pair_table, ratio_table, renderer_table
from posse_core._evaluation.numbers import number
from posse_core._evaluation.pages import heading, page, paragraph, strip, table


def make_page(comparisons: Sequence[Comparison], verdicts: Sequence[Verdict]) -> str:
    """HTML of all cases: verdicts, tables, and a strip of pictures a frame."""
    broken = [verdict for verdict in verdicts if not verdict.passed]
    summary = f"{len(verdicts) - len(broken)} of {len(verdicts)} thresholds hold."
    body = [_verdicts(verdicts), *(part for comparison in comparisons for part in _case(comparison))]
    title = "Crosscheck of " + ", ".join(comparison.name for comparison in comparisons)
    return page(title, summary, body)


def _verdicts(verdicts: Sequence[Verdict]) -> Markup:
    rows = [
        (v.case, v.who, v.what, number(v.value), number(v.limit), "holds" if v.passed else "broken")
        for v in verdicts
    ]
    broken = [i for i, verdict in enumerate(verdicts) if not verdict.passed]
    return table(("case", "who", "what", "value", "limit", ""), rows, broken)


def _case(comparison: Comparison) -> Iterator[Markup]:
    yield heading(comparison.name)
    for name, cause in comparison.failures.items():
        yield paragraph(f"{name} failed: {cause}", broken=True)
    for name, said in comparison.versions.items():
        words = ", ".join(f"{key} {value}" for key, value in said.items())
        yield paragraph(f"{name}: {words}")
    yield _html(renderer_table("renderer, against geometry", comparison.renderers))
    if comparison.pairs:
        yield _html(pair_table("pair", comparison.pairs))
        yield _html(ratio_table("radiance ratio by material", comparison.materials))
        yield _html(ratio_table("radiance ratio by part", comparison.parts))
    yield paragraph(
        "Pictures: each renderer, to the power 1/2.2, the brightest per cent white. Then light as a"
        " ratio: blue half, red twice, grey too dark to say. Then coverage minus the exact one: blue a"
        " quarter of a pixel too little, red too much."
    )
    yield from map(_strip, comparison.frames)


def _strip(frame: FrameMeasures) -> Markup:
    words = f"frame {frame.index}: {frame.range_m:.1f} m, phase {np.degrees(frame.phase_rad):.0f}°"
    ratios = [
        f"{pair} {number(shared.radiance_ratio)} (SSIM {number(shared.ssim)})"
        for pair, shared in frame.pairs.items()
    ]
    return strip("; ".join([words, *ratios]), frame.pictures.captions, frame.pictures.jpegs)


def _html(made: Table) -> Markup:
    return table(made.header, made.rows)
