"""Executors: where frames are made."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from posse_core._errors import ComponentError
from posse_core._model.label_line import LabelLine
from posse_core._plugins.component import Component, OptionsT

Made = TypeVar("Made")
MadeBy = TypeVar("MadeBy", covariant=True)


@dataclass(frozen=True)
class FrameMade:
    """What the worker of a run returns of a frame whose files are complete.

    Attributes:
        labels: its line.
        sha256: path of each of its files in the dataset → SHA-256.
    """

    labels: LabelLine
    sha256: Mapping[str, str]


class FrameWorker(Protocol[MadeBy]):
    """Makes frames in one worker process, as long as the process lives."""

    def make(self, index: int) -> MadeBy:
        """Make frame ``index``, write its files, and return a picklable record of it: in a run, a
        :class:`FrameMade`."""
        ...

    def close(self) -> None:
        """Free the renderer."""
        ...


@dataclass(frozen=True)
class FrameResult(Generic[Made]):
    """What became of one frame: what its worker returned, or the error that ended the last try."""

    index: int
    made: Made | None
    error: str = ""


class WorkerSetupError(ComponentError):
    """A worker could not be made, so no frame can."""


class Executor(Component[OptionsT]):
    """Spreads frames over workers. A frame whose worker dies is tried again in a new one."""

    @abstractmethod
    def run(
        self, make_worker: Callable[[], FrameWorker[Made]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Made]]:
        """Make the frames, in any order; yield each as it is done.

        Args:
            make_worker: picklable; called once in each worker.

        Raises:
            WorkerSetupError: ``make_worker`` failed; no frame can be made.
            OSError: a worker could not write, as when the disk is full.
        """
