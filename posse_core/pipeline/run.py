"""A run: from a plan to a finished dataset, resumable after any end."""

from __future__ import annotations

import errno
import json
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from filelock import FileLock, Timeout

from posse_core.dataset import Dataset, write_camera, write_spacecraft
from posse_core.errors import ComponentError, InputError, PosseError
from posse_core.files import write_bytes, write_json
from posse_core.interfaces.executor import Executor, FrameResult
from posse_core.pipeline.frame_maker import FrameMaker, create
from posse_core.pipeline.manifest import COMPLETE, make_manifest
from posse_core.pipeline.plan import Plan
from posse_core.pipeline.shards import LabelLog
from posse_core.plugins import Plugins
from posse_core.scenario.load import dump_scenario
from posse_core.trajectory import save_trajectory

Progress = Callable[[Iterable[FrameResult], int, int], Iterable[FrameResult]]
"""Wraps the results of a run to show them: (results, frames in all, frames done before)."""


@dataclass(frozen=True)
class RunResult:
    """How a run ended.

    Attributes:
        frames: in the dataset's plan; made: in this run; failed: frame → why.
    """

    folder: Path
    frames: int
    made: int
    failed: dict[int, str]
    seconds: float


def run(
    plan: Plan,
    folder: Path,
    plugins: Plugins,
    executor: Executor,
    *,
    resume: bool,
    progress: Progress,
) -> RunResult:
    """Make the dataset of a plan in ``folder``; with ``resume``, only what is not there yet.

    Raises:
        InputError: the folder holds another run, is in use, or cannot be written to.
        ComponentError: a worker could not be made.
    """
    fresh = _claim(folder, plan, resume=resume)
    try:
        with FileLock(folder / ".lock", timeout=0):
            result = _Run(plan, folder, plugins).make(executor, progress)
            (folder / ".lock").unlink(missing_ok=True)
            return result
    except Timeout:
        raise InputError(f"{folder}: another run is writing there; wait for it to end") from None
    except (OSError, PosseError) as error:
        nothing_made = fresh and not any(folder.glob("labels/*.jsonl"))
        if nothing_made:
            shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, OSError):
            raise _explained(error, folder, kept=not nothing_made) from error
        raise


def _claim(folder: Path, plan: Plan, *, resume: bool) -> bool:
    """Make sure that the folder is this run's; True when nothing was in it."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file; name a folder that does not exist yet")
    taken = folder.exists() and any(not path.name.startswith(".") for path in folder.iterdir())
    if not taken:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = (error.strerror or "").lower()
            raise InputError(f"--out {folder}: cannot be made ({reason}); name another folder") from None
        return True
    scenario_file = folder / "scenario.yaml"
    if not scenario_file.exists():
        raise InputError(f"--out {folder}: is not empty and holds no run; name another folder")
    if not resume:
        raise InputError(
            f"--out {folder}: holds another run; name another folder, or go on with it by --resume"
        )
    if scenario_file.read_text("utf-8") != dump_scenario(plan.scenario):
        raise InputError(
            f"--out {folder}: its run has another scenario than this one; resume it without"
            " naming a scenario or options, or name another folder"
        )
    return False


class _Run:
    def __init__(self, plan: Plan, folder: Path, plugins: Plugins) -> None:
        self._plan = plan
        self._folder = folder
        self._plugins = plugins
        self._failed: dict[int, str] = {}

    def make(self, executor: Executor, progress: Progress) -> RunResult:
        started = time.monotonic()
        self._write_statics()
        frames = len(self._plan.trajectory)
        self._log = LabelLog(self._folder, frames)
        done = self._log.recover()
        todo = [index for index in range(frames) if index not in done]
        if todo or not self._is_complete():
            (self._folder / "manifest.json").unlink(missing_ok=True)
            self._plugins.notify("posse_run_started", dataset=self._folder, frames=frames)
            results = executor.run(partial(FrameMaker, self._folder.absolute()), todo)
            for result in progress(results, frames, len(done)):
                self._enter(result)
            self._finish()
        made = len(todo) - len(self._failed)
        return RunResult(self._folder, frames, made, self._failed, time.monotonic() - started)

    def _write_statics(self) -> None:
        """What does not change from frame to frame; the scenario first, since it marks the folder."""
        plan, folder = self._plan, self._folder
        if not (folder / "scenario.yaml").exists():
            write_bytes(folder / "scenario.yaml", dump_scenario(plan.scenario).encode())
        if not (folder / "trajectory.npz").exists():
            save_trajectory(plan.trajectory, folder / "trajectory.npz")
        for name in ("spacecraft", "images", "truth"):
            (folder / name).mkdir(exist_ok=True)
        write_camera(plan.scenario.camera.camera(), folder / "camera.json")
        write_spacecraft(plan.spacecraft, folder / "spacecraft")

    def _is_complete(self) -> bool:
        path = self._folder / "manifest.json"
        return path.exists() and json.loads(path.read_text("utf-8"))["state"] == COMPLETE

    def _enter(self, result: FrameResult) -> None:
        if result.made is None:
            self._failed[result.index] = result.error
            return
        labels = result.made["labels"]
        self._log.append(labels, result.made["sha256"])
        self._plugins.notify("posse_frame_completed", index=result.index, labels=labels)

    def _finish(self) -> None:
        """Labels in order, exports, then the manifest: the last file of a run."""
        self._log.put_in_order()
        dataset = Dataset(self._folder)
        registry = self._plugins.registry
        if dataset.frames:
            for choice in self._plan.scenario.writers:
                create(registry, "writer", choice).write(dataset, self._folder)
        manifest = make_manifest(self._folder, self._plan, self._plugins, self._failed)
        write_json(self._folder / "manifest.json", manifest)
        self._plugins.notify("posse_run_finished", dataset=self._folder, manifest=manifest)


def _explained(error: OSError, folder: Path, *, kept: bool) -> PosseError:
    """The error of a store that refused, in words."""
    way_out = "; go on with --resume: the frames made so far are kept" if kept else ""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(f"--out {folder}: the disk is full; free some space{way_out}")
    if error.errno in (errno.EACCES, errno.EROFS, errno.EPERM, errno.ENOTDIR, errno.ENAMETOOLONG):
        reason = (error.strerror or "").lower()
        return InputError(f"--out {folder}: cannot be written to ({reason}); name another folder")
    return ComponentError(f"{folder}: {error}{way_out}")
