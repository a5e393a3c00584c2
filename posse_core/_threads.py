"""Work that is divided among the threads that this process may use."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")


def thread_count() -> int:
    """How many threads this process may use: ``POSSE_THREADS``, which executors set to a worker's share
    of the cores, or else, where that is no number above 0, one for each core."""
    share = os.environ.get("POSSE_THREADS", "")
    return int(share) if share.isdecimal() and int(share) else os.cpu_count() or 1


@functools.cache
def _libraries() -> ThreadpoolController:
    """The libraries of this process that have threads of their own."""
    return ThreadpoolController()


def one_thread_for_algebra() -> AbstractContextManager[Any]:
    """Within this context, products of matrices are computed in the thread that asks for them.

    The matrices of a frame are small. Other threads make their products no quicker, and wait for the
    next one by spinning: a frame would take twice the processor time.
    """
    within: AbstractContextManager[Any] = _libraries().limit(limits=1, user_api="blas")
    return within


def in_threads(work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Do some work on each item, on several at a time, and return the results in the items' order.

    Only what spends its time in libraries that let other threads run, as NumPy does on large arrays,
    becomes quicker. The first exception that the work raises is raised again.
    """
    threads = min(thread_count(), len(items))
    if threads <= 1:
        return [work(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))
