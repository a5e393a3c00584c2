"""What pages of results share: one HTML file that needs nothing else, its tables, pictures and plots.

The HTML stands in ``page.html`` and ``parts.html``; text is escaped where it is put in.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import jinja2
from markupsafe import Markup

from posse_core._arrays import AnyArray
from posse_core._errors import ComponentError
from posse_core._evaluation.numbers import number

COLOURS = (
    *("#1667b5", "#d1495b", "#2e933c", "#8f5ab8", "#c77d0a"),
    *("#5c6b73", "#17a2b8", "#7a4b22", "#b83280", "#8a9a0b"),
)


@dataclass(frozen=True)
class _Area:
    """A plot's size and the borders of what is between its axes, px; y is downward."""

    width: int = 460
    height: int = 310
    left: int = 58
    right: int = 446
    top: int = 44
    bottom: int = 272


def page(title: str, summary: str, body: Iterable[Markup]) -> str:
    """The whole page; ``body`` is HTML, the rest plain text."""
    return _templates().get_template("page.html").render(title=title, summary=summary, body=body)


def heading(text: str) -> Markup:
    """The heading of a section, from plain text."""
    return Markup("<h2>{}</h2>").format(text)


def paragraph(text: str, *, broken: bool = False) -> Markup:
    """A paragraph of plain text; one that says what is ``broken`` stands out."""
    return Markup('<p class="broken">{}</p>' if broken else "<p>{}</p>").format(text)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], broken: Collection[int] = ()) -> Markup:
    """A table, with columns of numbers to the right; the rows whose indices are ``broken`` are
    highlighted."""
    kinds = ["number" if all(map(_is_number, column)) else "" for column in zip(*rows, strict=True)]
    return _part("table", header=header, rows=rows, kinds=kinds or [""] * len(header), broken=broken)


def _is_number(cell: str) -> bool:
    """Whether a cell is a number, or stands for one that is not there."""
    try:
        float(cell)
    except ValueError:
        return cell in ("", "-", "–")
    return True


def strip(title: str, captions: Sequence[str], jpegs: Sequence[bytes]) -> Markup:
    """Pictures side by side, each over its caption."""
    coded = (base64.b64encode(jpeg).decode() for jpeg in jpegs)
    return _part("strip", title=title, pictures=zip(captions, coded, strict=True))


@cache
def _templates() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("posse_core._evaluation", ""),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {"number": number, "px": "{:.1f}".format}
    return environment


def _part(name: str, **values: Any) -> Markup:
    """The macro ``name`` of ``parts.html``."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(**values)
    return made


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


def plot(title: str, x: Axis, y: Axis, series: Sequence[Series]) -> Markup:
    """An SVG of several series over the same axes, each in its own colour, with a legend."""
    area = _Area()

    def across(value: float) -> float:
        return area.left + (area.right - area.left) * x.share(value)

    def down(value: float) -> float:
        return area.bottom + (area.top - area.bottom) * y.share(value)

    return _part(
        "plot",
        title=title,
        x=x,
        y=y,
        area=area,
        columns=[(across(value), value) for value in x.ticks()],
        rows=[(down(value), value) for value in y.ticks()],
        drawn=[
            (one, COLOURS[i % len(COLOURS)], [(across(u), down(v)) for u, v in one.points])
            for i, one in enumerate(series)
        ],
    )
