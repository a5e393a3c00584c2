"""The learning curves of a training as a self-contained HTML page with SVG plots."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence

MEANINGS: Mapping[str, str] = {
    "heat": "loss of the maps of centres (focal loss), for each spacecraft",
    "overlap": "loss of the boxes: twice 1 − their generalised overlap with the true ones",
    "sides": "loss of the logarithms of the distances from a centre to the sides of its box",
    "proposal class": "loss of whether an anchor holds a spacecraft (cross-entropy)",
    "proposal box": "loss of the proposals' boxes",
    "class": "loss of the classes of the regions (cross-entropy); background is one of them",
    "box": "loss of the regions' boxes",
    "place": "loss of the keypoints' distributions over the square (divergence from the true ones)",
    "valid mAP": "on the valid part: COCO's average precision over overlaps of 0.5 to 0.95; 1 is best",
    "valid mAP50": "on the valid part: average precision at an overlap of 0.5; 1 is best",
    "valid mAR": "on the valid part: COCO's average recall; 1 is best",
    "valid AR100": "on the valid part: share of the true boxes that one of the best 100 proposals meets",
    "valid AR1k": "the same of the best 1000 proposals",
    "valid AR100 without NMS": "the same of the best 100 proposals where none is suppressed",
    "valid AR1k without NMS": "the same of the best 1000 proposals where none is suppressed",
    "valid median error, %": "on the valid part: median error of keypoints, % of the input's side",
    "valid within sigma": "on the valid part: share of coordinates within their standard deviation",
    "valid poses in 95 %": "on the valid part: share of poses in the region that is to hold 95 %",
}
"""Quantity of a training → what it means. Losses are means over an epoch's batches; 0 is best, and
training minimises their sum."""

_WIDTH, _HEIGHT, _MARGIN = 640, 220, 44


def page(title: str, history: Sequence[Mapping[str, float]]) -> str:
    """Return an HTML page that plots every quantity by epoch and states its value at the last epoch."""
    names = list(dict.fromkeys(name for row in history for name in row if name != "epoch"))
    plots = "".join(_plot(name, history) for name in names)
    return (
        f"<!doctype html><meta charset='utf-8'><title>{html.escape(title)}</title>"
        "<style>body{font:15px sans-serif;max-width:700px;margin:2em auto}"
        "svg{width:100%;background:#fafafa}</style>"
        f"<h1>{html.escape(title)}</h1>"
        f"<p>Training minimises the sum of the losses; 0 is best.</p>{plots}"
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
        f"<h2>{html.escape(name)}: {values[-1]:.4g}</h2><p>{html.escape(MEANINGS[name])}</p>"
        f"<svg viewBox='0 0 {_WIDTH} {_HEIGHT}'>"
        f"<text x='2' y='{_MARGIN / 2}' font-size='12'>{high:.3g}</text>"
        f"<text x='2' y='{_HEIGHT - _MARGIN / 2}' font-size='12'>{low:.3g}</text>"
        f"<text x='{_WIDTH - _MARGIN}' y='{_HEIGHT - 4}' font-size='12'>epoch {last:g}</text>"
        f"<polyline points='{line}' fill='none' stroke='#1667b5' stroke-width='2'/></svg>"
    )
