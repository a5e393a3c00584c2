"""The conformance class for executors."""

from __future__ import annotations

import errno
import os
import tempfile
import time
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from posse_core._interfaces.executor import Executor, FrameResult, WorkerSetupError
from posse_core.testing.conformance import Conformance

INDICES = (0, 2, 3, 7, 8, 9)
_ODD = 3
"""The frame with which something happens."""
_GONE_S = 20.0
"""Time within which a process that was told to end must have ended."""


@dataclass(frozen=True)
class Ticket:
    """What the kit's worker returns of a frame: its index, and the process that made it."""

    index: int
    pid: int


class Worker:
    """Notes in a folder that it was made and what it makes; ``fault`` happens in frame 3."""

    def __init__(self, folder: Path, fault: str = "", seconds: float = 0.0) -> None:
        if fault == "cannot be made":
            raise RuntimeError("the lamp is not plugged in")
        self._folder, self._fault, self._seconds = folder, fault, seconds
        _note(folder, "worker")

    def make(self, index: int) -> Ticket:
        note = _note(self._folder, f"frame-{index}")
        if index == _ODD:
            if self._fault == "exception":
                raise ValueError("the lamp in frame 3 is broken")
            if self._fault == "full disk":
                raise OSError(errno.ENOSPC, "No space left on device")
            if self._fault == "death once" and len(list(self._folder.glob("frame-3-*"))) == 1:
                os._exit(1)
        time.sleep(self._seconds)
        note.rename(note.with_suffix(".made"))
        return Ticket(index, os.getpid())

    def close(self) -> None:
        """See :class:`posse_core.FrameWorker`."""


class ExecutorConformance(Conformance):
    """What every executor must do. A subclass provides :meth:`executor`.

    Attributes:
        in_process: whether frames are made in the process that calls the executor, one after another.
            Then there are no workers that could be lost.
    """

    in_process = False

    @abstractmethod
    def executor(self, workers: int) -> Executor[Any]:
        """A new executor of so many workers."""

    def test_every_frame_is_made_once(self) -> None:
        """And its result is what the worker returned, under its own index."""
        with self._notes() as notes:
            results = self._results(notes.folder)
            indices = sorted(result.index for result in results)
            assert indices == list(INDICES), (
                f"asked for the frames {list(INDICES)}, it gave results of {indices}; is a frame lost at"
                " the end, or given out twice?"
            )
            for result in results:
                assert isinstance(result, FrameResult), f"it yields {type(result).__name__}, not results"
                assert result.made is not None, f"frame {result.index} failed: {result.error}"
                assert result.made.index == result.index, (
                    f"the result of frame {result.index} is what frame {result.made.index} returned; are"
                    " results matched to indices in the order in which they come?"
                )
            for index in INDICES:
                times = notes.times(f"frame-{index}")
                assert times == 1, f"frame {index} was made {times} times; frames take minutes"

    def test_no_frames(self) -> None:
        with self._notes() as notes:
            assert self._results(notes.folder, indices=()) == [], "there are results of no frames"

    def test_a_frame_that_raises_is_its_own_result(self) -> None:
        """The exception is told with its type and message, it is not tried again, and all others are
        made."""
        with self._notes() as notes:
            results = {result.index: result for result in self._results(notes.folder, "exception")}
            assert results.keys() == set(INDICES), (
                f"there are results of {sorted(results)} only; an exception of one frame ended the run"
            )
            assert results[_ODD].made is None, "the frame raised, and has a result"
            error = results[_ODD].error
            assert "ValueError" in error, f"the error {error!r} does not tell the exception's type"
            assert "the lamp in frame 3 is broken" in error, (
                f"the error {error!r} does not have the exception's message; give it in full"
            )
            failed = [i for i in INDICES if i != _ODD and results[i].made is None]
            assert not failed, f"frames {failed} failed with frame 3; were they lost with its worker?"
            times = notes.times(f"frame-{_ODD}")
            assert times == 1, f"the frame was made {times} times; what it raised it would raise again"

    def test_a_worker_that_cannot_be_made_ends_the_run(self) -> None:
        """By a ``WorkerSetupError`` that has the cause."""
        with self._notes() as notes:
            results, error = self._ending(notes.folder, "cannot be made")
            assert isinstance(error, WorkerSetupError), (
                f"no worker can be made, and the run ends with {len(results)} results and {error!r}"
                " instead of a WorkerSetupError; make frames by posse_core.make_frame_in_process"
            )
            assert "the lamp is not plugged in" in str(error), (
                f"the error {str(error)!r} does not tell why the worker cannot be made"
            )

    def test_a_full_disk_ends_the_run(self) -> None:
        """An error that every other frame would meet, too, is raised to the caller."""
        with self._notes() as notes:
            results, error = self._ending(notes.folder, "full disk")
            assert isinstance(error, OSError), (
                f"the disk is full, and the run goes on with {len(results)} results and {error!r}; ask"
                " posse_core.FrameAttempts.raised what becomes of an exception"
            )
            assert error.errno == errno.ENOSPC, f"the error has lost its number: {error!r}"

    def test_the_frame_of_a_worker_that_dies_is_tried_again(self) -> None:
        """In a new process, unless ``in_process``; no other frame is lost."""
        if self.in_process:
            return
        with self._notes() as notes:
            results = {result.index: result for result in self._results(notes.folder, "death once")}
            assert results.keys() == set(INDICES), f"there are results of {sorted(results)} only"
            lost = {i: result.error for i, result in results.items() if result.made is None}
            assert not lost, (
                f"a worker died once in frame 3, and frames were given up: {lost}; a frame is tried"
                " again as long as posse_core.FrameAttempts.lost returns None"
            )

    def test_workers_are_as_many_as_asked_for(self) -> None:
        """They are made once each, and work at the same time, unless ``in_process``."""
        with self._notes() as notes:
            made = [r.made for r in self._results(notes.folder, seconds=0.4) if r.made is not None]
            pids = {ticket.pid for ticket in made}
            wanted = 1 if self.in_process else 2
            assert len(pids) <= wanted, f"asked for {wanted} workers, it had {len(pids)}"
            times = notes.times("worker")
            assert times <= wanted, (
                f"{times} workers were made for {len(INDICES)} frames; making one opens a renderer, so"
                " a process keeps its own"
            )
            if not self.in_process:
                assert os.getpid() not in pids, "frames are made in the caller's process"
                assert len(pids) == 2, "one of two workers made no frame; are frames given out in turn?"

    def test_nothing_is_left_when_the_caller_stops(self) -> None:
        """After the first result the caller stops, as ``Ctrl-C`` does; no worker goes on."""
        for way in ("close", "KeyboardInterrupt"):
            with self._notes() as notes:
                results = self._run(notes.folder, seconds=0.2)
                assert isinstance(results, Iterator), "run() must yield results as they come"
                first = next(results)
                assert first.made is not None, f"frame {first.index} failed: {first.error}"
                if way == "close":
                    results.close()  # type: ignore[attr-defined]
                else:
                    try:
                        results.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
                    except KeyboardInterrupt:
                        pass
                    else:
                        raise AssertionError(
                            "it swallowed KeyboardInterrupt, so Ctrl-C cannot end a run"
                        )
                assert _ended(notes.pids()), (
                    f"after {way}, processes still make frames; end them in a finally around the yields"
                )
                before = len(list(notes.folder.iterdir()))
                time.sleep(0.5)
                assert len(list(notes.folder.iterdir())) == before, (
                    f"after {way}, frames are still being made"
                )

    def _results(
        self, folder: Path, fault: str = "", seconds: float = 0.0, indices: Any = INDICES
    ) -> list[FrameResult[Ticket]]:
        return list(self._run(folder, fault, seconds, indices))

    def _ending(self, folder: Path, fault: str) -> tuple[list[FrameResult[Ticket]], Exception | None]:
        """The results of a run, and the exception that ended it."""
        try:
            return self._results(folder, fault), None
        except Exception as error:
            return [], error

    def _run(
        self, folder: Path, fault: str = "", seconds: float = 0.0, indices: Any = INDICES
    ) -> Iterator[FrameResult[Ticket]]:
        executor = self.executor(1 if self.in_process else 2)
        return executor.run(partial(Worker, folder, fault, seconds), iter(indices))

    @contextmanager
    def _notes(self) -> Iterator[_Notes]:
        with tempfile.TemporaryDirectory(prefix="posse-executor-kit-") as folder:
            notes = _Notes(Path(folder))
            yield notes
            if not self.in_process:
                assert _ended(notes.pids()), "processes of workers are left after the last result"


@dataclass(frozen=True)
class _Notes:
    """What workers noted in a folder: empty files ``WHAT-PID-NUMBER``."""

    folder: Path

    def times(self, what: str) -> int:
        return len(list(self.folder.glob(f"{what}-*")))

    def pids(self) -> set[int]:
        return {int(path.stem.split("-")[-2]) for path in self.folder.iterdir()} - {os.getpid()}


def _note(folder: Path, what: str) -> Path:
    descriptor, path = tempfile.mkstemp(".begun", f"{what}-{os.getpid()}-", folder)
    os.close(descriptor)
    return Path(path)


def _ended(pids: set[int]) -> bool:
    """Whether processes end soon; one that has ended and is not yet waited for counts as ended."""
    deadline = time.monotonic() + _GONE_S
    while any(map(_runs, pids)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        state = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    except ProcessLookupError:
        return False
    except OSError:  # no /proc on this system, or the process has just ended
        return Path("/proc").exists() is False
    return state != "Z"
