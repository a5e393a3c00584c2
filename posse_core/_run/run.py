"""A run makes the dataset of a plan. It can be resumed however it ended."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from posse_core._dataset.camera import write_camera
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import (
    CAMERA,
    IMAGES,
    LABELS,
    MANIFEST,
    SCENARIO,
    SPACECRAFT,
    TRAJECTORY,
    TRUTH,
)
from posse_core._dataset.spacecraft import write_spacecraft
from posse_core._errors import ComponentError, InputError, PosseError, StoreError
from posse_core._files.atomic import PARTIAL, write_bytes, write_json
from posse_core._files.store import is_remote
from posse_core._files.trajectory import save_trajectory
from posse_core._interfaces.executor import Executor, FrameMade, FrameResult
from posse_core._model.manifest import Manifest
from posse_core._plugins.loading import Plugins
from posse_core._plugins.registry import Registry
from posse_core._run.destination import Destination, open_destination
from posse_core._run.exports import export_digests
from posse_core._run.manifest import make_manifest
from posse_core._run.plan import Plan
from posse_core._run.shards import LabelLog
from posse_core._run.worker import RunWorker
from posse_core._scenario.component import create
from posse_core._scenario.load import dump_scenario
from posse_core._simulator.returned import written

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
    """

    out: str
    frames: int
    made: int
    failed: dict[int, str]
    seconds: float


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
    if not is_remote(out) and Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"--out {out}: is a file; choose a folder that does not exist yet")
    if is_remote(out):
        _check_writers(plan, plugins.registry)
    destination = open_destination(out)
    made_some = False
    try:
        with destination.claimed():
            fresh = _check_claim(destination, out, plan, resume=resume)
            try:
                return _Run(plan, out, destination, plugins).make(executor, progress)
            except (OSError, PosseError):
                made_some = not fresh or any((destination.folder / LABELS).glob("*.jsonl"))
                if not made_some:
                    destination.discard()
                raise
    except OSError as error:
        raise _explained(error, out, kept=made_some) from error
    except StoreError as error:
        raise StoreError(f"{error}{_how_to_continue(made_some)}") from None


def _check_claim(destination: Destination, out: str, plan: Plan, *, resume: bool) -> bool:
    """Check that the destination is empty or holds this run; return whether it was empty."""
    if all(path.name.startswith(".") for path in destination.folder.iterdir()):
        return True
    scenario_file = destination.folder / SCENARIO
    if not scenario_file.exists():
        raise InputError(f"--out {out}: is not empty and contains no run; choose another folder")
    if not resume:
        raise InputError(
            f"--out {out}: contains another run; choose another folder, or continue it with --resume"
        )
    if scenario_file.read_text("utf-8") != dump_scenario(plan.scenario):
        raise InputError(
            f"--out {out}: its run has another scenario than this one; resume it without"
            " a scenario or options, or choose another folder"
        )
    return False


def _check_writers(plan: Plan, registry: Registry) -> None:
    for choice in plan.scenario.writers:
        if "labels-only" not in registry.spec("writer", choice.name).capabilities:
            raise InputError(
                f"writers: {choice.name!r} reads images, which are not on this machine in a run to a"
                " network store; leave it out, and use 'posse export' on a copy of the dataset"
            )


class _Run:
    def __init__(self, plan: Plan, out: str, destination: Destination, plugins: Plugins) -> None:
        self._plan = plan
        self._out = out
        self._destination = destination
        self._folder = destination.folder
        self._plugins = plugins
        self._failed: dict[int, str] = {}

    def make(self, executor: Executor, progress: Progress) -> RunResult:
        started = time.monotonic()
        self._write_statics()
        frames = len(self._plan.trajectory)
        self._log = LabelLog(self._folder, frames)
        store = self._destination.store
        done = self._log.recover(store.sha256, store.read_threads)
        todo = [index for index in range(frames) if index not in done]
        if todo or not self._is_complete():
            (self._folder / MANIFEST).unlink(missing_ok=True)
            self._destination.save()
            self._plugins.notify("posse_run_started", dataset=self._folder, frames=frames)
            results = executor.run(partial(RunWorker, self._destination.store.location), todo)
            awaited = set(todo)
            for result in progress(results, frames, len(done)):
                awaited.discard(result.index)
                self._record(result)
            self._failed |= dict.fromkeys(awaited, "the executor gave no result")
            self._finish()
            self._destination.save()
        made = len(todo) - len(self._failed)
        return RunResult(self._out, frames, made, self._failed, time.monotonic() - started)

    def _write_statics(self) -> None:
        """Write the files that do not depend on frames; first the scenario, which marks a dataset."""
        plan, folder = self._plan, self._folder
        if not (folder / SCENARIO).exists():
            write_bytes(folder / SCENARIO, dump_scenario(plan.scenario).encode())
        if not (folder / TRAJECTORY).exists():
            save_trajectory(plan.trajectory, folder / TRAJECTORY)
        for name in (SPACECRAFT, IMAGES, TRUTH, LABELS):
            (folder / name).mkdir(exist_ok=True)
        for part in (".", SPACECRAFT, IMAGES, TRUTH, LABELS):
            for name in os.listdir(folder / part):
                if name.endswith(PARTIAL):
                    (folder / part / name).unlink(missing_ok=True)
        write_camera(plan.scenario.camera.camera(), folder / CAMERA)
        write_spacecraft(plan.spacecraft, folder / SPACECRAFT)

    def _is_complete(self) -> bool:
        try:
            return Manifest.from_json((self._folder / MANIFEST).read_bytes()).is_complete
        except (FileNotFoundError, InputError):
            return False

    def _record(self, result: FrameResult[FrameMade]) -> None:
        if result.made is None:
            self._failed[result.index] = result.error
            return
        made = result.made
        self._destination.frame_logged(self._log.append(made.labels, made.sha256))
        self._plugins.notify("posse_frame_completed", index=result.index, labels=made.labels)

    def _finish(self) -> None:
        """Sort the labels, write the exports, and then the manifest as the last file of a run."""
        self._log.put_in_order()
        dataset = Dataset(self._folder)
        registry = self._plugins.registry
        paths: list[Path] = []
        if len(dataset):
            for choice in self._plan.scenario.writers:
                writer = create(registry, "writer", choice)
                paths += written(writer, choice.name, dataset, self._folder)
        exports = export_digests(paths, self._folder)
        manifest = make_manifest(self._destination, self._plan, self._plugins, self._failed, exports)
        write_json(self._folder / MANIFEST, manifest.as_json())
        self._plugins.notify("posse_run_finished", dataset=self._folder, manifest=manifest)


def _how_to_continue(kept: bool) -> str:
    return "; continue with --resume: the frames made so far are kept" if kept else ""


def _explained(error: OSError, out: str, *, kept: bool) -> PosseError:
    """Turn an error of the disk into one that says what to do."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(f"--out {out}: the disk is full; free some space{_how_to_continue(kept)}")
    if error.errno in (errno.EACCES, errno.EROFS, errno.EPERM, errno.ENOTDIR, errno.ENAMETOOLONG):
        reason = (error.strerror or "").lower()
        return InputError(f"--out {out}: cannot be written to ({reason}); choose another folder")
    return ComponentError(f"{out}: {error}{_how_to_continue(kept)}")
