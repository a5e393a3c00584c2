"""A run: from a plan to a finished dataset, resumable after any end."""

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
from posse_core._run.exports import export_digests
from posse_core._run.manifest import make_manifest
from posse_core._run.place import Place, place_at
from posse_core._run.plan import Plan
from posse_core._run.shards import LabelLog
from posse_core._run.worker import RunWorker
from posse_core._scenario.component import create
from posse_core._scenario.load import dump_scenario
from posse_core._simulator.returned import written

Progress = Callable[[Iterable[FrameResult[FrameMade]], int, int], Iterable[FrameResult[FrameMade]]]
"""Wraps the results of a run to show them: (results, frames in all, frames done before)."""


@dataclass(frozen=True)
class RunResult:
    """How a run ended.

    Attributes:
        frames: in the dataset's plan; made: in this run; failed: frame → why.
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
    """Make the dataset of a plan at ``out``, a path or a URL; with ``resume``, only what is not there.

    Raises:
        InputError: the folder holds another run, is in use, or cannot be written to.
        ComponentError: a worker could not be made, or a network store refuses.
    """
    if not is_remote(out) and Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"--out {out}: is a file; name a folder that does not exist yet")
    if is_remote(out):
        _check_writers(plan, plugins.registry)
    place = place_at(out)
    made_some = False
    try:
        with place.claimed():
            fresh = _check_claim(place, out, plan, resume=resume)
            try:
                return _Run(plan, out, place, plugins).make(executor, progress)
            except (OSError, PosseError):
                made_some = not fresh or any((place.books / LABELS).glob("*.jsonl"))
                if not made_some:
                    place.discard()
                raise
    except OSError as error:
        raise _explained(error, out, kept=made_some) from error
    except StoreError as error:
        raise StoreError(f"{error}{_way_on(made_some)}") from None


def _check_claim(place: Place, out: str, plan: Plan, *, resume: bool) -> bool:
    """Make sure that the place is this run's; True when nothing was in it."""
    if all(path.name.startswith(".") for path in place.books.iterdir()):
        return True
    scenario_file = place.books / SCENARIO
    if not scenario_file.exists():
        raise InputError(f"--out {out}: is not empty and holds no run; name another folder")
    if not resume:
        raise InputError(
            f"--out {out}: holds another run; name another folder, or go on with it by --resume"
        )
    if scenario_file.read_text("utf-8") != dump_scenario(plan.scenario):
        raise InputError(
            f"--out {out}: its run has another scenario than this one; resume it without"
            " naming a scenario or options, or name another folder"
        )
    return False


def _check_writers(plan: Plan, registry: Registry) -> None:
    for choice in plan.scenario.writers:
        if "labels-only" not in registry.spec("writer", choice.name).capabilities:
            raise InputError(
                f"writers: {choice.name!r} reads images, which a run to a network store does not have"
                " at hand; leave it out, and 'posse export' a copy of the dataset"
            )


class _Run:
    def __init__(self, plan: Plan, out: str, place: Place, plugins: Plugins) -> None:
        self._plan = plan
        self._out = out
        self._place = place
        self._folder = place.books
        self._plugins = plugins
        self._failed: dict[int, str] = {}

    def make(self, executor: Executor, progress: Progress) -> RunResult:
        started = time.monotonic()
        self._write_statics()
        frames = len(self._plan.trajectory)
        self._log = LabelLog(self._folder, frames)
        store = self._place.store
        done = self._log.recover(store.sha256, store.read_threads)
        todo = [index for index in range(frames) if index not in done]
        if todo or not self._is_complete():
            (self._folder / MANIFEST).unlink(missing_ok=True)
            self._place.save()
            self._plugins.notify("posse_run_started", dataset=self._folder, frames=frames)
            results = executor.run(partial(RunWorker, self._place.store.location), todo)
            awaited = set(todo)
            for result in progress(results, frames, len(done)):
                awaited.discard(result.index)
                self._enter(result)
            self._failed |= dict.fromkeys(awaited, "the executor gave no result")
            self._finish()
            self._place.save()
        made = len(todo) - len(self._failed)
        return RunResult(self._out, frames, made, self._failed, time.monotonic() - started)

    def _write_statics(self) -> None:
        """What does not change from frame to frame; the scenario first, since it marks the folder."""
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

    def _enter(self, result: FrameResult[FrameMade]) -> None:
        if result.made is None:
            self._failed[result.index] = result.error
            return
        made = result.made
        self._place.entered(self._log.append(made.labels, made.sha256))
        self._plugins.notify("posse_frame_completed", index=result.index, labels=made.labels)

    def _finish(self) -> None:
        """Labels in order, exports, then the manifest: the last file of a run."""
        self._log.put_in_order()
        dataset = Dataset(self._folder)
        registry = self._plugins.registry
        paths: list[Path] = []
        if len(dataset):
            for choice in self._plan.scenario.writers:
                writer = create(registry, "writer", choice)
                paths += written(writer, choice.name, dataset, self._folder)
        exports = export_digests(paths, self._folder)
        manifest = make_manifest(self._place, self._plan, self._plugins, self._failed, exports)
        write_json(self._folder / MANIFEST, manifest.as_json())
        self._plugins.notify("posse_run_finished", dataset=self._folder, manifest=manifest)


def _way_on(kept: bool) -> str:
    return "; go on with --resume: the frames made so far are kept" if kept else ""


def _explained(error: OSError, out: str, *, kept: bool) -> PosseError:
    """The error of a disk that refused, in words."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(f"--out {out}: the disk is full; free some space{_way_on(kept)}")
    if error.errno in (errno.EACCES, errno.EROFS, errno.EPERM, errno.ENOTDIR, errno.ENAMETOOLONG):
        reason = (error.strerror or "").lower()
        return InputError(f"--out {out}: cannot be written to ({reason}); name another folder")
    return ComponentError(f"{out}: {error}{_way_on(kept)}")
