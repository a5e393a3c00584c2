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


def array_fault(
    array: object, shape: tuple[int | None, ...], kind: str, *, finite: bool = True
) -> str | None:
    """What is wrong with an array from outside, in words that follow its name; None if nothing is.

    Args:
        shape: that it must have; None stands for any length.
        kind: what its numbers must be, in NumPy's words: ``floating``, ``integer``, ``float32``.
        finite: NaN and infinity are wrong.
    """
    if not isinstance(array, np.ndarray):
        return f"is {type(array).__name__}, and must be a NumPy array"
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.issubdtype(array.dtype, getattr(np, kind)):
        sides = ", ".join("n" if wanted is None else str(wanted) for wanted in shape)
        sides += "," if len(shape) == 1 else ""
        return f"is {array.dtype} of shape {array.shape}, and must be {kind} of shape ({sides})"
    if finite and not np.isfinite(array).all():
        return "has numbers that are not finite"
    return None
