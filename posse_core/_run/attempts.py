"""What executors of worker processes share: making a frame in a process, and handling its failures."""

from __future__ import annotations

import errno
import os
from collections import Counter
from collections.abc import Callable
from typing import Any

import cv2
from pydantic import Field

from posse_core._errors import StoreError
from posse_core._interfaces.executor import FrameResult, FrameWorker, WorkerSetupError
from posse_core._plugins.options import Options

_STORE_FAILED = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EIO}
"""Errors that would occur again for every attempt and every other frame."""


class PoolOptions(Options):
    """Options of an executor of worker processes: their number, and the limits of a frame."""

    workers: int = Field(1, ge=1, le=1024, description="number of worker processes")
    frames_per_worker: int = Field(
        500, ge=1, description="frames after which a worker is replaced, so that its memory stays small"
    )
    frame_time_limit_s: float = Field(
        1800.0, gt=0, description="time after which a frame is stopped and tried again"
    )
    tries: int = Field(3, ge=1, description="largest number of tries of a frame whose worker dies")


class FrameAttempts:
    """Counts the tries of each frame and decides whether it is tried again.

    A frame is tried again when its worker was lost. An exception that the frame itself raises is its
    result. Each method returns the frame's result, or None if the executor must try the frame again.
    """

    def __init__(self, options: PoolOptions) -> None:
        self._options = options
        self._losses: Counter[int] = Counter()

    def lost(self, index: int, why: str) -> FrameResult[Any] | None:
        """Report that the frame's worker died; ``why`` goes into the error of the last try."""
        self._losses[index] += 1
        if self._losses[index] < self._options.tries:
            return None
        return FrameResult(index, None, f"{why}, {self._losses.pop(index)} times")

    def overdue(self, index: int) -> FrameResult[Any] | None:
        """Report that the frame exceeded the time limit and its worker was stopped."""
        return self.lost(index, f"it took over {self._options.frame_time_limit_s:g} s")

    def raised(self, index: int, error: Exception) -> FrameResult[Any] | None:
        """Report that making the frame raised ``error``.

        Raises:
            WorkerSetupError, StoreError, OSError: ``error`` itself, if it must end the run.
        """
        if isinstance(error, WorkerSetupError | StoreError) or (
            isinstance(error, OSError) and error.errno in _STORE_FAILED
        ):
            raise error
        return FrameResult(index, None, f"{type(error).__name__}: {error}")


_worker: FrameWorker[Any] | None = None


def make_frame_in_process(make_worker: Callable[[], FrameWorker[Any]], index: int) -> Any:
    """Make a frame with the frame worker of this process, which is made at the first frame.

    An executor calls this function in its worker processes. Their environment sets ``POSSE_THREADS``,
    the number of CPU threads that each may use.

    Returns:
        What :meth:`FrameWorker.make` returned.

    Raises:
        WorkerSetupError: ``make_worker`` failed.
    """
    global _worker
    if _worker is None:
        cv2.setNumThreads(int(os.environ["POSSE_THREADS"]))
        try:
            _worker = make_worker()
        except StoreError:
            raise
        except Exception as error:
            raise WorkerSetupError(str(error)) from error
    return _worker.make(index)
