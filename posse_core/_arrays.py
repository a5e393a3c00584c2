"""Names for the array types that cross borders, and the indices of an even choice.

Shapes, units and frames stand in the docstrings of what takes and returns the arrays.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Float32Array: TypeAlias = NDArray[np.float32]
IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
AnyArray: TypeAlias = NDArray[Any]


def evenly_spread(total: int, count: int) -> IntArray:
    """``count`` of the indices 0 … total − 1, evenly spread from the first to the last.

    All of them, where ``count`` is not below ``total``; ascending, each once.
    """
    return np.linspace(0, total - 1, min(count, total)).round().astype(np.int64)
