"""Frames of a dataset judged in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from posse_core._detection.evaluate import Judge, Judged
from posse_core._errors import ComponentError, PosseError
from posse_core._interfaces.executor import Executor
from posse_core._plugins.registry import Registry


def judged(
    judge: Judge,
    positions: Iterable[int],
    make_judge: Callable[[], Judge],
    workers: int,
    registry: Registry,
) -> Iterator[Judged]:
    """Judge frames, in any order.

    Args:
        judge: of this process, which judges them all if there is one worker.
        positions: of the frames in the dataset.
        make_judge: picklable; makes the judge of a worker.
        workers: number of worker processes.
        registry: the installed components, of which the executor ``local`` is used.

    Raises:
        InputError: the labels lack what is measured.
        ComponentError: a component failed, or a worker died again and again.
    """
    if workers == 1:
        yield from map(judge.make, positions)
        return
    options = registry.options("executor", "local", {"workers": workers})
    executor: Executor = registry.create("executor", "local", options)
    for result in executor.run(partial(_Telling, make_judge), positions):
        if result.made is None:
            raise ComponentError(f"frame {result.index} could not be judged: {result.error}")
        if isinstance(result.made, PosseError):
            raise result.made
        yield result.made


class _Telling:
    """A judge whose errors are returned: those that it raised would only be told in words."""

    def __init__(self, make_judge: Callable[[], Judge]) -> None:
        self._judge = make_judge()

    def make(self, index: int) -> Judged | PosseError:
        try:
            return self._judge.make(index)
        except PosseError as error:
            return error

    def close(self) -> None:
        self._judge.close()
