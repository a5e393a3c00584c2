"""What every executor of worker processes does alike: a frame in its process, and what its end means."""

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
"""What no other try and no other frame would fare better with."""


class PoolOptions(Options):
    """Options of an executor of worker processes: how many there are, and when one is given up."""

    workers: int = Field(1, ge=1, le=1024, description="number of worker processes")
    frames_per_worker: int = Field(
        500, ge=1, description="a worker is replaced after so many frames, before its memory grows"
    )
    frame_time_limit_s: float = Field(
        1800.0, gt=0, description="a frame that takes longer is stopped and tried again"
    )
    tries: int = Field(3, ge=1, description="how often a frame is tried when its worker dies")


class FrameAttempts:
    """Counts how often each frame has been tried, and says whether it is to be tried again.

    An exception that a frame raises is its result: only the loss of a worker is worth another try. Each
    method returns the frame's result, or None where the executor is to try the frame again.
    """

    def __init__(self, options: PoolOptions) -> None:
        self._options = options
        self._losses: Counter[int] = Counter()

    def lost(self, index: int, why: str) -> FrameResult[Any] | None:
        """The frame's worker died; ``why`` is said in the error of the last try."""
        self._losses[index] += 1
        if self._losses[index] < self._options.tries:
            return None
        return FrameResult(index, None, f"{why}, {self._losses.pop(index)} times")

    def overdue(self, index: int) -> FrameResult[Any] | None:
        """The frame took longer than it may, and its worker was stopped."""
        return self.lost(index, f"it took over {self._options.frame_time_limit_s:g} s")

    def raised(self, index: int, error: Exception) -> FrameResult[Any] | None:
        """Making the frame raised ``error``.

        Raises:
            WorkerSetupError, StoreError, OSError: ``error`` itself, where it ends the run.
        """
        if isinstance(error, WorkerSetupError | StoreError) or (
            isinstance(error, OSError) and error.errno in _STORE_FAILED
        ):
            raise error
        return FrameResult(index, None, f"{type(error).__name__}: {error}")


_worker: FrameWorker[Any] | None = None


def make_frame_in_process(make_worker: Callable[[], FrameWorker[Any]], index: int) -> Any:
    """Make a frame with this process's one frame worker, which is made at the first frame.

    An executor calls it in its worker processes, whose environment sets ``POSSE_THREADS``, the number
    of CPU threads that each may use.

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
