"""Executors: where frames are made."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from posse_core._errors import ComponentError
from posse_core._plugins.component import Component, OptionsT


class FrameWorker(Protocol):
    """Makes frames in one worker; lives as long as the worker."""

    def make(self, index: int) -> Mapping[str, Any]:
        """Make frame ``index``, write its files, return what the run is to know of it."""
        ...

    def close(self) -> None:
        """Free the renderer."""
        ...


@dataclass(frozen=True)
class FrameResult:
    """What became of one frame: what its worker returned, or the error that ended the last try."""

    index: int
    made: Mapping[str, Any] | None
    error: str = ""


class WorkerSetupError(ComponentError):
    """A worker could not be made, so no frame can."""


class Executor(Component[OptionsT]):
    """Spreads frames over workers. A frame whose worker dies is tried again in a new one."""

    @abstractmethod
    def run(
        self, make_worker: Callable[[], FrameWorker], indices: Iterable[int]
    ) -> Iterator[FrameResult]:
        """Make the frames, in any order; yield each as it is done.

        Args:
            make_worker: picklable; called once in each worker.

        Raises:
            WorkerSetupError: ``make_worker`` failed; no frame can be made.
            OSError: a worker could not write, as when the disk is full.
        """
