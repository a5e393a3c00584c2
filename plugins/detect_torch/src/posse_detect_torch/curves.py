"""The learning curves of a training as a self-contained HTML page with SVG plots."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence

_WIDTH, _HEIGHT, _MARGIN = 640, 220, 44


def page(title: str, history: Sequence[Mapping[str, float]]) -> str:
    """Return an HTML page that plots every quantity by epoch and states its value at the last epoch."""
    names = list(dict.fromkeys(name for row in history for name in row if name != "epoch"))
    plots = "".join(_plot(name, history) for name in names)
    return (
        f"<!doctype html><meta charset='utf-8'><title>{html.escape(title)}</title>"
        "<style>body{font:15px sans-serif;max-width:700px;margin:2em auto}"
        "svg{width:100%;background:#fafafa}</style>"
        f"<h1>{html.escape(title)}</h1>{plots}"
    )


def _plot(name: str, history: Sequence[Mapping[str, float]]) -> str:
    points = [(row["epoch"], row[name]) for row in history if name in row]
    values = [value for _, value in points]
    low, high = min(0.0, *values, 0.0), max(values)
    span, last = (high - low) or 1.0, max(points[-1][0], 2)

    def plot_point(epoch: float, value: float) -> str:
        x = _MARGIN + (epoch - 1) / (last - 1) * (_WIDTH - 2 * _MARGIN)
        y = _HEIGHT - _MARGIN / 2 - (value - low) / span * (_HEIGHT - _MARGIN)
        return f"{x:.1f},{y:.1f}"

    line = " ".join(plot_point(epoch, value) for epoch, value in points)
    return (
        f"<h2>{html.escape(name)}: {values[-1]:.4g}</h2>"
        f"<svg viewBox='0 0 {_WIDTH} {_HEIGHT}'>"
        f"<text x='2' y='{_MARGIN / 2}' font-size='12'>{high:.3g}</text>"
        f"<text x='2' y='{_HEIGHT - _MARGIN / 2}' font-size='12'>{low:.3g}</text>"
        f"<text x='{_WIDTH - _MARGIN}' y='{_HEIGHT - 4}' font-size='12'>epoch {last:g}</text>"
        f"<polyline points='{line}' fill='none' stroke='#1667b5' stroke-width='2'/></svg>"
    )
