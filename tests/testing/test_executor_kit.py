"""The kit of executors catches what it is there for."""

from __future__ import annotations

from typing import Any

import pytest

from posse_core import Executor, FrameAttempts, FrameResult, NoOptions, PoolOptions, WorkerSetupError
from posse_core._run.local import LocalExecutor
from posse_core.testing import ExecutorConformance

ONCE = "test_every_frame_is_made_once"
NONE = "test_no_frames"
RAISES = "test_a_frame_that_raises_is_its_own_result"
SETUP = "test_a_worker_that_cannot_be_made_ends_the_run"
DISK = "test_a_full_disk_ends_the_run"
DEATH = "test_the_frame_of_a_worker_that_dies_is_tried_again"
WORKERS = "test_workers_are_as_many_as_asked_for"
STOP = "test_nothing_is_left_when_the_caller_stops"

HERE = {
    "nothing": {},
    "last frame lost": {ONCE: "is a frame lost at the end"},
    "made twice": {ONCE: "was made 2 times"},
    "results in the order of their coming": {ONCE: "matched to indices"},
    "result of no frame": {NONE: "results of no frames"},
    "exception ends the run": {RAISES: "the lamp in frame 3"},
    "error without its type": {RAISES: "does not tell the exception's type"},
    "error without its message": {RAISES: "give it in full"},
    "exception tried again": {RAISES: "it would raise again"},
    "frames after an exception lost": {RAISES: "an exception of one frame ended the run"},
    "worker that cannot be made is each frame's": {SETUP: "instead of a WorkerSetupError"},
    "setup without its cause": {SETUP: "why the worker cannot be made"},
    "full disk is a frame's": {DISK: "the disk is full, and the run goes on"},
    "full disk without its number": {DISK: "lost its number"},
    "worker for each frame": {WORKERS: "workers were made for 6 frames"},
    "interrupt swallowed": {STOP: "swallowed KeyboardInterrupt"},
    "list instead of results as they come": {STOP: "must yield results"},
}
"""What is wrong with an executor in this process → the tests that fail and what they say."""
POOL = {
    "another number of workers": {WORKERS: "it had 3"},
    "one worker": {WORKERS: "made no frame"},
    "lost frame given up": {DEATH: "frames were given up"},
    "workers go on": {STOP: "processes still make frames"},
}
"""The same of a pool of processes."""


class Here(Executor[NoOptions]):
    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong

    def run(self, make_worker: Any, indices: Any) -> Any:
        made = self.results(make_worker, indices)
        return list(made) if self.wrong.startswith("list") else made

    def results(self, make_worker: Any, indices: Any) -> Any:
        wrong, attempts = self.wrong, FrameAttempts(PoolOptions())
        try:
            worker = make_worker()
        except Exception as error:
            if wrong.startswith("worker that cannot"):
                yield from (attempts.raised(index, error) for index in indices)
                return
            raise WorkerSetupError("" if wrong == "setup without its cause" else str(error)) from error
        todo = [*indices]
        if wrong == "result of no frame" and not todo:
            yield FrameResult(0, None, "none")
        for index in todo[:-1] if wrong == "last frame lost" else todo:
            if wrong == "worker for each frame":
                worker = make_worker()
            if wrong == "made twice" and index == 7:
                worker.make(index)
            try:
                result = FrameResult(index, worker.make(index))
            except Exception as error:
                result = self.failed(worker, attempts, index, error)
            if wrong == "results in the order of their coming":
                result = FrameResult(todo[-1 - todo.index(index)], result.made, result.error)
            try:
                yield result
            except KeyboardInterrupt:
                if wrong == "interrupt swallowed":
                    yield result
                raise
            if wrong == "frames after an exception lost" and result.made is None:
                return

    def failed(self, worker: Any, attempts: FrameAttempts, index: int, error: Exception) -> Any:
        wrong = self.wrong
        if wrong == "exception ends the run":
            raise error
        if wrong == "full disk without its number" and isinstance(error, OSError):
            raise OSError(str(error)) from error
        if wrong == "full disk is a frame's" and isinstance(error, OSError):
            return FrameResult(index, None, str(error))
        if wrong == "exception tried again":
            try:
                worker.make(index)
            except ValueError as again:
                error = again
        if wrong == "error without its type":
            return FrameResult(index, None, str(error))
        if wrong == "error without its message":
            return FrameResult(index, None, type(error).__name__)
        return attempts.raised(index, error)


class Pool(LocalExecutor):
    def __init__(self, wrong: str, workers: int) -> None:
        changed = {"another number of workers": 3, "one worker": 1}.get(wrong, workers)
        tries = 1 if wrong == "lost frame given up" else 3
        super().__init__(PoolOptions(workers=changed, tries=tries))
        self.wrong = wrong

    def run(self, make_worker: Any, indices: Any) -> Any:
        results = super().run(make_worker, indices)
        if self.wrong == "workers go on":
            KEPT.append(results)
            return (result for result in results)
        return results


KEPT: list[Any] = []
"""Results whose executor is not told that nobody wants them any more."""


@pytest.mark.parametrize("wrong", HERE)
def test_a_wrong_executor_fails_for_its_own_reason(wrong: str) -> None:
    class Case(ExecutorConformance):
        in_process = True

        def executor(self, workers: int) -> Executor:
            return Here(wrong)

    for test in (name for name in vars(ExecutorConformance) if name.startswith("test_")):
        reason = HERE[wrong].get(test)
        if reason is not None:
            with pytest.raises((AssertionError, ValueError), match=reason):
                getattr(Case(), test)()
        elif not HERE[wrong]:
            getattr(Case(), test)()


@pytest.mark.parametrize("wrong", POOL)
def test_a_wrong_pool_of_processes_fails_for_its_own_reason(
    wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Case(ExecutorConformance):
        def executor(self, workers: int) -> Executor:
            return Pool(wrong, workers)

    monkeypatch.setattr("posse_core.testing.executors._GONE_S", 1.0)
    ((test, reason),) = POOL[wrong].items()
    try:
        with pytest.raises(AssertionError, match=reason):
            getattr(Case(), test)()
    finally:
        while KEPT:
            KEPT.pop().close()
