"""What pages of results share: one HTML file that needs nothing else, its tables, pictures and plots."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from string import Template

import cv2

from posse_core._arrays import AnyArray
from posse_core._errors import ComponentError

COLOURS = ("#1667b5", "#d1495b", "#2e933c", "#8f5ab8", "#c77d0a", "#5c6b73")
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 460, 310, 58, 14, 44, 38


def page(title: str, summary: str, body: Iterable[str]) -> str:
    """The whole page; ``body`` is HTML, the rest plain text."""
    template = Template((resources.files(__package__) / "page.html").read_text("utf-8"))
    return template.substitute(
        title=html.escape(title), summary=html.escape(summary), body="\n".join(body)
    )


def number(value: float | None) -> str:
    """Four digits, or a dash."""
    return "–" if value is None else f"{value:.4g}"


def table(header: Sequence[str], rows: Sequence[Sequence[str]], broken: Collection[int] = ()) -> str:
    """A table; the rows whose places are ``broken`` stand out."""

    def row(cells: Sequence[str], tag: str, mark: str = "") -> str:
        inside = "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells)
        return f"<tr{mark}>{inside}</tr>"

    marks = (' class="broken"' if place in broken else "" for place in range(len(rows)))
    lines = (row(cells, "td", mark) for cells, mark in zip(rows, marks, strict=True))
    return f"<table>{row(header, 'th')}{''.join(lines)}</table>"


def strip(heading: str, captions: Sequence[str], jpegs: Sequence[bytes]) -> str:
    """Pictures side by side, each over its caption."""
    figures = [
        f'<figure><img alt="{html.escape(caption)}" src="data:image/jpeg;base64,'
        f'{base64.b64encode(jpeg).decode()}"><figcaption>{html.escape(caption)}</figcaption></figure>'
        for caption, jpeg in zip(captions, jpegs, strict=True)
    ]
    return f'<p>{html.escape(heading)}</p><div class="strip">{"".join(figures)}</div>'


def jpeg(image_bgr: AnyArray) -> bytes:
    """A (H, W, 3) uint8 picture, blue-green-red, as a JPEG file."""
    ok, data = cv2.imencode(".jpg", image_bgr, [cv2.IMWRITE_JPEG_QUALITY, 85])
    if not ok:
        raise ComponentError("a picture could not be coded as JPEG")
    return bytes(data)


@dataclass(frozen=True)
class Series:
    """Points of a plot, or a line through them.

    Attributes:
        name: for the legend.
        points: (x, y) pairs.
    """

    name: str
    points: Sequence[tuple[float, float]]
    line: bool = False


@dataclass(frozen=True)
class Axis:
    """One axis of a plot; ``log`` needs values above 0."""

    name: str
    low: float
    high: float
    log: bool = False

    @classmethod
    def over(cls, name: str, values: Iterable[float], log: bool = False) -> Axis:
        """From the least to the greatest value; from 0, if not logarithmic. Log axes span decades."""
        values = list(values)
        if log:
            low, high = (math.floor(math.log10(min(values))), math.ceil(math.log10(max(values))))
            return cls(name, 10.0**low, 10.0 ** max(high, low + 1), log)
        return cls(name, 0.0, max(values) or 1.0)

    def share(self, value: float) -> float:
        """Where a value stands: 0 at the low end, 1 at the high end."""
        if self.log:
            return math.log10(value / self.low) / math.log10(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """Round values to be marked: powers of ten, or steps of 1, 2 or 5 times one."""
        if self.log:
            first, last = round(math.log10(self.low)), round(math.log10(self.high))
            return [10.0**power for power in range(first, last + 1)]
        rough = (self.high - self.low) / 5
        size = 10.0 ** math.floor(math.log10(rough))
        step = next(factor * size for factor in (1, 2, 5, 10) if factor * size >= rough * 0.999)
        first, last = math.ceil(self.low / step), math.floor(self.high / step * (1 + 1e-9))
        return [step * count for count in range(first, last + 1)]


def plot(title: str, x: Axis, y: Axis, series: Sequence[Series]) -> str:
    """An SVG of several series over the same axes, each in its own colour, with a legend."""
    wide, tall = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def at(px: float, py: float) -> tuple[float, float]:
        return _LEFT + wide * x.share(px), _TOP + tall * (1 - y.share(py))

    out = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" role="img">'
        f'<text x="{_LEFT}" y="14" font-weight="600">{html.escape(title)}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 4}" text-anchor="end">{html.escape(x.name)}</text>'
        f'<text x="{_LEFT}" y="{_TOP - 12}">{html.escape(y.name)}</text>'
    ]
    legend = []
    for value in x.ticks():
        u, _ = at(value, y.low)
        out.append(f'<path class="grid" d="M{u:.1f} {_TOP}V{_TOP + tall}"/>')
        out.append(f'<text x="{u:.1f}" y="{_TOP + tall + 15}" text-anchor="middle">{value:.4g}</text>')
    for value in y.ticks():
        _, v = at(x.low, value)
        out.append(f'<path class="grid" d="M{_LEFT} {v:.1f}H{_LEFT + wide}"/>')
        out.append(f'<text x="{_LEFT - 6}" y="{v + 4:.1f}" text-anchor="end">{value:.4g}</text>')
    for place, one in enumerate(series):
        colour = COLOURS[place % len(COLOURS)]
        places = [at(*point) for point in one.points]
        if one.line:
            path = " ".join(f"{u:.1f},{v:.1f}" for u, v in places)
            out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        else:
            dots = "".join(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="2.5"/>' for u, v in places)
            out.append(f'<g fill="{colour}" fill-opacity=".6">{dots}</g>')
        legend.append(f'<tspan fill="{colour}" dx="10">{html.escape(one.name)}</tspan>')
    place_of_legend = f'x="{_WIDTH - _RIGHT}" y="{_TOP - 12}" text-anchor="end"'
    return "".join(out) + f"<text {place_of_legend}>{''.join(legend)}</text></svg>"
