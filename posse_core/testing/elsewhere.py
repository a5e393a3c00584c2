"""Calling a function in another process, as the workers of a run are."""

from __future__ import annotations

import multiprocessing
import pickle
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import Any, TypeVar

Result = TypeVar("Result")


def in_another_process(function: Callable[..., Result], kind: type, *arguments: Any) -> Result:
    """Call ``function(kind, *arguments)`` in a spawned process, whose hashes of strings are others.

    ``kind`` is the component's class, which the process imports by its name.
    """
    assert "<locals>" not in kind.__qualname__, (
        f"{kind.__qualname__} is defined within a function, so a worker cannot import it; a component's"
        " class stands at the top of a module"
    )
    asked = pickle.dumps((function, kind, *arguments))
    answer: Result = _process().submit(_called, sys.path, asked).result()
    return answer


def _called(path: list[str], asked: bytes) -> Any:
    sys.path[:] = path  # as it is now, and not when the process was started
    function, *arguments = pickle.loads(asked)
    return function(*arguments)


@cache
def _process() -> ProcessPoolExecutor:
    """One process for all tests, since starting one takes a second."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
