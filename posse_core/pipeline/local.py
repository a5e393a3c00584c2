"""The executor ``local``: worker processes on this machine."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from multiprocessing import get_context
from typing import Any

import cv2
from pebble import ProcessExpired, ProcessPool
from pydantic import Field

from posse_core.errors import WorkerLost
from posse_core.interfaces.executor import Executor, FrameResult, FrameWorker, WorkerSetupError
from posse_core.options import Options

_STORE_FAILED = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EIO}
"""What no other try and no other frame would fare better with."""


class LocalOptions(Options):
    """How many processes, and when one is given up."""

    workers: int = Field(1, ge=1, le=1024, description="number of worker processes")
    frames_per_worker: int = Field(
        500, ge=1, description="a worker is replaced after so many frames, before its memory grows"
    )
    frame_time_limit_s: float = Field(
        1800.0, gt=0, description="a frame that takes longer is stopped and tried again"
    )
    tries: int = Field(3, ge=1, description="how often a frame is tried when its worker dies")


class LocalExecutor(Executor):
    """A pool of spawned processes (pebble); a dead or hung worker is replaced, its frame tried again.

    An exception that a frame raises is its result: only the loss of a worker, or of a process that its
    renderer works in, is worth another try.
    """

    options: LocalOptions

    def run(
        self, make_worker: Callable[[], FrameWorker], indices: Iterable[int]
    ) -> Iterator[FrameResult]:
        workers = self.options.workers
        _share_cores(workers)
        waiting = iter(indices)
        tries: dict[int, int] = {}
        pending: dict[Future[Any], int] = {}
        pool: Any = ProcessPool(
            max_workers=workers,
            max_tasks=self.options.frames_per_worker,
            context=get_context("spawn"),
        )

        def submit(index: int) -> None:
            tries[index] = tries.get(index, 0) + 1
            future = pool.schedule(
                _make_frame, args=[make_worker, index], timeout=self.options.frame_time_limit_s
            )
            pending[future] = index

        try:
            for _, index in zip(range(2 * workers), waiting, strict=False):
                submit(index)
            while pending:
                for future in wait(pending, return_when=FIRST_COMPLETED).done:
                    index = pending.pop(future)
                    result = self._result(future, index, last=tries[index] >= self.options.tries)
                    if result is None:
                        submit(index)
                        continue
                    del tries[index]
                    yield result
                    following = next(waiting, None)
                    if following is not None:
                        submit(following)
            pool.close()
        except BaseException:
            pool.stop()
            raise
        finally:
            pool.join()

    def _result(self, future: Future[Any], index: int, *, last: bool) -> FrameResult | None:
        """The frame's result, or None where it is to be tried again."""
        try:
            return FrameResult(index, future.result())
        except ProcessExpired as error:
            if not last:
                return None
            cause = f"its worker died {self.options.tries} times (exit code {error.exitcode})"
        except TimeoutError:
            if not last:
                return None
            cause = f"it took over {self.options.frame_time_limit_s:g} s {self.options.tries} times"
        except WorkerLost as error:
            if not last:
                return None
            cause = f"{error} ({self.options.tries} times)"
        except WorkerSetupError:
            raise
        except Exception as error:  # whatever a component raises ends its frame, not the run
            if isinstance(error, OSError) and error.errno in _STORE_FAILED:
                raise
            cause = f"{type(error).__name__}: {error}"
        return FrameResult(index, None, cause)


_worker: FrameWorker | None = None


def _make_frame(make_worker: Callable[[], FrameWorker], index: int) -> Mapping[str, Any]:
    """Runs in the worker process, whose one frame worker is made at the first frame."""
    global _worker
    if _worker is None:
        cv2.setNumThreads(int(os.environ["POSSE_THREADS"]))
        try:
            _worker = make_worker()
        except Exception as error:
            raise WorkerSetupError(str(error)) from error
    try:
        return _worker.make(index)
    except WorkerLost:
        _worker.close()
        _worker = None
        raise


def _share_cores(workers: int) -> None:
    """Let the numerical libraries of each worker use its share of the cores (spawned children inherit
    this); what the user has set stands."""
    share = str(max(1, (os.cpu_count() or 1) // workers))
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POSSE_THREADS"):
        os.environ.setdefault(variable, share)
