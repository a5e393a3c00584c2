"""Numbers as tables show them."""

from __future__ import annotations

import math
from decimal import Decimal

LEAST = 1e-9
"""Smaller numbers are rounding errors of what POSSE measures in metres, radians and shares."""


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits; a dash for None, NaN and infinity.

    Counts (int) have all their digits. Numbers below :data:`LEAST` are not shown in digits, which would
    mean nothing, and large ones are shown without an exponent.
    """
    if isinstance(value, int):
        return str(value)
    if value is None or not math.isfinite(value):
        return "–"
    if 0 < abs(value) < LEAST:
        return f"< {LEAST:g}".replace("e-0", "e-")
    text = f"{value:.{digits}g}"
    return format(Decimal(text), "f") if "e+" in text else text
