"""The executor ``local``: worker processes on this machine."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from itertools import islice
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Lock
from types import ModuleType
from typing import Any

from pebble import ProcessExpired, ProcessPool

from posse_core._interfaces.executor import Executor, FrameResult, FrameWorker, Made
from posse_core._run.attempts import FrameAttempts, PoolOptions, make_frame_in_process


class LocalExecutor(Executor[PoolOptions]):
    """Makes frames in a pool of spawned processes (pebble).

    A worker that dies or hangs is replaced, and its frame is tried again.
    """

    def run(
        self, make_worker: Callable[[], FrameWorker[Made]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Made]]:
        workers = self.options.workers
        _share_cores(workers)
        waiting = iter(indices)
        attempts = FrameAttempts(self.options)
        pending: dict[Future[Any], int] = {}
        pool: Any = ProcessPool(
            max_workers=workers,
            max_tasks=self.options.frames_per_worker,
            context=_SpawnContext(),
        )

        def submit(index: int) -> None:
            future = pool.schedule(
                make_frame_in_process, args=[make_worker, index], timeout=self.options.frame_time_limit_s
            )
            pending[future] = index

        try:
            for index in islice(waiting, 2 * workers):
                submit(index)
            while pending:
                for future in wait(pending, return_when=FIRST_COMPLETED).done:
                    index = pending.pop(future)
                    result = _result(future, index, attempts)
                    if result is None:
                        submit(index)
                        continue
                    yield result
                    for following in islice(waiting, 1):
                        submit(following)
            pool.close()
        except BaseException:
            pool.stop()
            raise
        finally:
            pool.join()


class _WithoutMain(SpawnProcess):
    """A spawned process that does not import the program's main module.

    A worker does not need that module, and a script without ``if __name__ == "__main__"`` would start
    again in every worker.
    """

    def start(self) -> None:
        with _starting:
            main = sys.modules["__main__"]
            sys.modules["__main__"] = ModuleType("__main__")
            try:
                super().start()
            finally:
                sys.modules["__main__"] = main


class _SpawnContext(SpawnContext):
    Process = _WithoutMain


_starting = Lock()


def _result(future: Future[Any], index: int, attempts: FrameAttempts) -> FrameResult[Any] | None:
    """Return the frame's result, or None if it must be tried again."""
    try:
        return FrameResult(index, future.result())
    except ProcessExpired as error:
        return attempts.lost(index, f"its worker died (exit code {error.exitcode})")
    except TimeoutError:
        return attempts.overdue(index)
    except Exception as error:  # whatever a component raises ends its frame, not the run
        return attempts.raised(index, error)


def _share_cores(workers: int) -> None:
    """Limit the numerical libraries of each worker to its share of the cores.

    Spawned processes inherit these environment variables. Values that the user has set are kept.
    """
    share = str(max(1, (os.cpu_count() or 1) // workers))
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POSSE_THREADS"):
        os.environ.setdefault(variable, share)
