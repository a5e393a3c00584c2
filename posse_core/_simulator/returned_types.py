"""Checks that what a component returned has the type and the shape that it must have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from posse_core._arrays import FloatArray, array_fault
from posse_core._errors import ComponentError

T = TypeVar("T")


def of_type(made: object, wanted: type[T], who: str) -> T:
    """What was made, if it has the type; ``who`` made it."""
    if not isinstance(made, wanted):
        raise ComponentError(f"{who} returned {type_of(made)}, and must return {wanted.__name__}")
    return made


def type_of(value: object) -> str:
    """What a value is, in words."""
    return "None" if value is None else f"a value of type {type(value).__name__}"


def sequence(made: object, who: str, wanted: str) -> Sequence[Any]:
    """What was made, if it is a sequence and no string."""
    if not isinstance(made, Sequence) or isinstance(made, str):
        raise ComponentError(f"{who} returned {type_of(made)}, and must return {wanted}")
    return made


def floats(value: object, shape: tuple[int | None, ...], what: str) -> FloatArray:
    """(shape) float64 of an array or of nested lists."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ComponentError(f"{what} is {type_of(value)}, and must be an array of numbers") from None
    check(array, shape, "floating", what)
    return array


def check(
    array: object,
    shape: tuple[int | None, ...],
    kind: str,
    what: str,
    *,
    finite: bool = True,
) -> None:
    """Check an array's shape, with None for any number, and its kind; see :func:`array_fault`."""
    fault = array_fault(array, shape, kind, finite=finite)
    if fault is not None:
        raise ComponentError(f"{what} {fault}")
