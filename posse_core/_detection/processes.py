"""Images in which several processes search."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

from posse_core._errors import ComponentError, PosseError
from posse_core._interfaces.executor import Executor, FrameWorker, Made
from posse_core._plugins.registry import Registry


def made_by(
    worker: FrameWorker[Made],
    indices: Iterable[int],
    make_worker: Callable[[], FrameWorker[Made]],
    workers: int,
    registry: Registry,
) -> Iterator[Made]:
    """What a worker makes of each image, in their order.

    Args:
        worker: of this process, which makes everything if there is to be one.
        indices: of the images.
        make_worker: picklable; makes the worker of another process.
        workers: number of processes.
        registry: the installed components, of which the executor ``local`` is used.

    Raises:
        PosseError: as the worker raised it.
        ComponentError: a worker failed otherwise, or its process died again and again.
    """
    if workers == 1:
        yield from map(worker.make, indices)
        return
    options = registry.options("executor", "local", {"workers": workers})
    executor: Executor[Any] = registry.create("executor", "local", options)
    order, waiting = deque[int](), dict[int, Made]()

    def begun() -> Iterator[int]:
        for index in indices:
            order.append(index)
            yield index

    for result in executor.run(partial(_Telling, make_worker), begun()):
        if isinstance(result.made, PosseError):
            raise result.made
        if result.made is None:
            raise ComponentError(f"the worker of image {result.index} failed: {result.error}")
        waiting[result.index] = result.made
        while order and order[0] in waiting:
            yield waiting.pop(order.popleft())


class _Telling(FrameWorker[Made | PosseError]):
    """A worker whose errors are returned: those that it raised would only be told in words."""

    def __init__(self, make_worker: Callable[[], FrameWorker[Made]]) -> None:
        self._worker = make_worker()

    def make(self, index: int) -> Made | PosseError:
        try:
            return self._worker.make(index)
        except PosseError as error:
            return error

    def close(self) -> None:
        self._worker.close()
