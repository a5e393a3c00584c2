"""The executor ``ray``: actors of a Ray cluster, or of this machine if no cluster is named."""

from __future__ import annotations

import logging
import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from posse_core import (
    ComponentError,
    Executor,
    FrameAttempts,
    FrameResult,
    FrameWorker,
    PoolOptions,
    WorkerSetupError,
    make_frame_in_process,
)


class FrameActor:
    """A worker process with one frame worker, and therefore one renderer."""

    def __init__(
        self, make_worker: Callable[[], FrameWorker[Any]], environment: Mapping[str, str]
    ) -> None:
        os.environ.update(environment)
        self._make_worker = make_worker

    def is_ready(self) -> bool:
        """Return True; the call is answered once the cluster has started the actor."""
        return True

    def make(self, index: int) -> Any:
        """Make a frame."""
        return make_frame_in_process(self._make_worker, index)


@dataclass
class _Task:
    """A call of an actor: for the frame with an index or, at first (None), whether it is ready."""

    actor: Any
    index: int | None
    frames_before: int
    deadline_s: float


class RayExecutor(Executor[PoolOptions]):
    """Makes frames in one actor per worker; an actor that dies or hangs is replaced.

    Every actor makes one frame at a time. Frames are given only to actors that have started, so a
    cluster without resources for all of them works with fewer.
    """

    def run(
        self, make_worker: Callable[[], FrameWorker[Any]], indices: Iterable[int]
    ) -> Iterator[FrameResult[Any]]:
        todo = deque(indices)
        if not todo:
            return
        _connect()
        try:
            yield from _Actors(self.options, make_worker, todo).results()
        finally:
            ray.shutdown()


class _Actors:
    def __init__(
        self, options: PoolOptions, make_worker: Callable[[], FrameWorker[Any]], todo: deque[int]
    ) -> None:
        self._options = options
        self._todo = todo
        self._attempts = FrameAttempts(options)
        self._failed_starts = 0
        self._tasks: dict[Any, _Task] = {}
        self._new_actor = _actor_maker(options.workers, make_worker)

    def results(self) -> Iterator[FrameResult[Any]]:
        for _ in range(min(self._options.workers, len(self._todo))):
            self._start_actor()
        while self._todo or any(task.index is not None for task in self._tasks.values()):
            left_s = min(task.deadline_s for task in self._tasks.values()) - time.monotonic()
            timeout_s = None if math.isinf(left_s) else max(0.0, left_s)
            answered, _ = ray.wait(list(self._tasks), timeout=timeout_s)
            overdue = [] if answered else [min(self._tasks, key=lambda r: self._tasks[r].deadline_s)]
            for reference in answered or overdue:
                result = self._settle(reference, is_overdue=not answered)
                if result is not None:
                    yield result

    def _settle(self, reference: Any, *, is_overdue: bool) -> FrameResult[Any] | None:
        """Handle an actor's answer, then give the actor its next frame or replace it."""
        task = self._tasks.pop(reference)
        index, frames = task.index, task.frames_before
        if index is None:
            is_alive, result = self._has_started(reference), None
        else:
            is_alive, result = self._outcome(reference, index, is_overdue=is_overdue)
            frames += 1
            if result is None:
                self._todo.appendleft(index)
        if is_alive and self._todo and frames < self._options.frames_per_worker:
            following = self._todo.popleft()
            deadline_s = time.monotonic() + self._options.frame_time_limit_s
            asked = task.actor.make.remote(following)
            self._tasks[asked] = _Task(task.actor, following, frames, deadline_s)
        else:
            ray.kill(task.actor)
            if self._todo:
                self._start_actor()
        return result

    def _outcome(
        self, reference: Any, index: int, *, is_overdue: bool
    ) -> tuple[bool, FrameResult[Any] | None]:
        """Return whether the actor is alive, and the frame's result or None to try it again."""
        if is_overdue:
            return False, self._attempts.overdue(index)
        try:
            return True, FrameResult(index, ray.get(reference))
        except RayTaskError as error:
            return True, self._attempts.raised(index, error.cause)
        except RayError as error:
            return False, self._attempts.lost(index, f"its worker died ({type(error).__name__})")

    def _start_actor(self) -> None:
        actor = self._new_actor()
        self._tasks[actor.is_ready.remote()] = _Task(actor, None, 0, math.inf)

    def _has_started(self, reference: Any) -> bool:
        try:
            ray.get(reference)
        except RayError as error:
            self._failed_starts += 1
            if self._failed_starts == self._options.tries:
                reason = " ".join(str(error).split())
                raise WorkerSetupError(f"ray: its actors cannot start: {reason}") from None
            return False
        self._failed_starts = 0
        return True


def _connect() -> None:
    """Connect to the cluster that RAY_ADDRESS names, or start one on this machine."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    address = os.environ.get("RAY_ADDRESS", "local")
    try:
        ray.init(address, include_dashboard=False, logging_level=logging.WARNING, log_to_driver=False)
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ComponentError(f"ray: no cluster at {address!r} (RAY_ADDRESS): {reason}") from None


def _actor_maker(workers: int, make_worker: Callable[[], FrameWorker[Any]]) -> Callable[[], Any]:
    """Return a function that makes actors, which share the cluster's cores and GPUs evenly."""
    # Ray has no types for this function
    resources = ray.cluster_resources()  # type: ignore[no-untyped-call]
    cores, gpus = resources.get("CPU", 1.0), resources.get("GPU", 0.0)
    environment = {name: value for name, value in os.environ.items() if name.startswith("POSSE_")}
    environment.setdefault("POSSE_THREADS", str(max(1, int(cores // workers))))
    actor_class = ray.remote(
        num_cpus=min(1.0, math.floor(1e3 * cores / workers) / 1e3),
        num_gpus=1 / math.ceil(workers / gpus) if gpus else 0,
        scheduling_strategy="SPREAD",
    )(FrameActor)
    given = ray.put(make_worker)
    return lambda: actor_class.remote(given, environment)
