"""The transfer curve of sRGB (IEC 61966-2-1) between coded and linear values, both as shares of full
scale.

It is applied to each colour channel separately, for values from 0 to 1. An 8-bit sRGB code, as in the
textures of a spacecraft, is 255 times the coded share.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from posse_core._arrays import Float32Array, FloatArray

_MEET = 0.0031308
_Floats = TypeVar("_Floats", FloatArray, Float32Array)


def linear_from_srgb(coded: FloatArray) -> FloatArray:
    """Coded share 0 … 1 → linear share 0 … 1, any shape."""
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: _Floats) -> _Floats:
    """Linear share 0 … 1 → coded share 0 … 1, any shape, in the same precision."""
    # The curve is below the line from where they meet; until there the line is below that value.
    coded: _Floats = np.maximum(linear, _MEET)
    np.power(coded, 1 / 2.4, out=coded)
    coded *= 1.055
    coded -= 0.055
    np.minimum(coded, 12.92 * linear, out=coded)
    return coded
