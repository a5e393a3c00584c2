"""Interface of executors, which make the frames of a run in workers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from posse_core._dataset.remarks import Remark
from posse_core._errors import ComponentError
from posse_core._model.label_line import LabelLine
from posse_core._plugins.component import Component, OptionsT

Made = TypeVar("Made")
MadeBy = TypeVar("MadeBy", covariant=True)


@dataclass(frozen=True)
class FrameMade:
    """The result of a run's worker for a frame whose files are complete.

    Attributes:
        labels: the frame's label line.
        sha256: path of each of the frame's files in the dataset → SHA-256.
        remark: what is remarkable about the frame, None for nothing.
    """

    labels: LabelLine
    sha256: Mapping[str, str]
    remark: Remark | None = None


class FrameWorker(Protocol[MadeBy]):
    """Makes frames in one worker process, for the lifetime of the process."""

    def make(self, index: int) -> MadeBy:
        """Make frame ``index``, write its files, and return a picklable record of it.

        In a run the record is a :class:`FrameMade`.
        """
        ...

    def close(self) -> None:
        """Free the renderer."""
        ...


@dataclass(frozen=True)
class FrameResult(Generic[Made]):
    """The outcome of one frame: what its worker returned, or the error that ended the last try."""

    index: int
    made: Made | None
    error: str = ""


class WorkerSetupError(ComponentError):
    """A worker could not be made, so no frame can be made."""


class Executor(Component[OptionsT]):
    """Distributes frames over workers. A frame whose worker dies is tried again in a new one."""

    @abstractmethod
    def run(
        self, make_worker: Callable[[], FrameWorker[Made]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Made]]:
        """Make the frames in any order, and yield the result of each when it is done.

        Args:
            make_worker: picklable function, called once in each worker.
            indices: of the frames.

        Raises:
            WorkerSetupError: ``make_worker`` failed, so no frame can be made.
            OSError: A worker could not write, for instance because the disk is full.
        """
