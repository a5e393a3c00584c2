"""A run makes the dataset of a plan. It can be resumed however it ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from posse_core._dataset.remarks import Remark
from posse_core._errors import InputError
from posse_core._files.store import is_remote
from posse_core._interfaces.executor import Executor, FrameMade, FrameResult
from posse_core._plugins.loading import Plugins
from posse_core._plugins.registry import Registry
from posse_core._run.plan import Plan
from posse_core._run.recording import Recording, recording
from posse_core._run.worker import RunWorker

Progress = Callable[[Iterable[FrameResult[FrameMade]], int, int], Iterable[FrameResult[FrameMade]]]
"""Wraps the results of a run to show its progress: (results, frames in total, frames done before)."""


@dataclass(frozen=True)
class RunResult:
    """The result of a run.

    Attributes:
        out: the dataset's location.
        frames: number of frames in the plan.
        made: number of frames made by this run.
        failed: index of a frame → why it failed.
        seconds: duration of the run.
        remarks: remark → number of the dataset's frames that it is made on, those of earlier runs too.
    """

    out: str
    frames: int
    made: int
    failed: dict[int, str]
    seconds: float
    remarks: Mapping[Remark, int]


def run(
    plan: Plan,
    out: str,
    plugins: Plugins,
    executor: Executor,
    *,
    resume: bool,
    progress: Progress,
) -> RunResult:
    """Make the dataset of a plan at ``out``, a path or a URL.

    With ``resume``, only the frames that are missing are made.

    Raises:
        InputError: The folder contains another run, is in use, or cannot be written to.
        ComponentError: A worker could not be made, or a network store refuses.
    """
    if is_remote(out):
        _check_writers(plan, plugins.registry)
    started = time.monotonic()
    frames = len(plan.trajectory)
    with recording(
        out,
        plan.scenario,
        plan.scene,
        frames,
        plugins,
        sensors=plan.sensors,
        trajectory=plan.trajectory,
        resume=resume,
    ) as dataset:
        todo = [index for index in range(frames) if index not in dataset.done]
        failed: dict[int, str] = {}
        if todo or not dataset.is_complete:
            failed = _make(dataset, todo, frames, executor, progress)
        remarks = dataset.remarks()
    made = len(todo) - len(failed)
    return RunResult(out, frames, made, failed, time.monotonic() - started, remarks)


def _make(
    dataset: Recording, todo: list[int], frames: int, executor: Executor, progress: Progress
) -> dict[int, str]:
    """Make frames; return index of a frame → why it failed."""
    dataset.begin()
    failed: dict[int, str] = {}
    results = executor.run(partial(RunWorker, dataset.store.location), todo)
    awaited = set(todo)
    for result in progress(results, frames, len(dataset.done)):
        awaited.discard(result.index)
        if result.made is None:
            failed[result.index] = result.error
        else:
            dataset.add(result.made)
    failed |= dict.fromkeys(awaited, "the executor gave no result")
    dataset.finish(failed)
    return failed


def _check_writers(plan: Plan, registry: Registry) -> None:
    for choice in plan.scenario.writers:
        if "labels-only" not in registry.spec("writer", choice.name).capabilities:
            raise InputError(
                f"writers: {choice.name!r} reads images, which are not on this machine in a run to a"
                " network store; leave it out, and use 'posse export' on a copy of the dataset"
            )
