"""Recording a dataset: its folder is claimed, frames are logged as they come, and the end is written."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from posse_core._dataset.camera import write_camera
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import (
    BODIES,
    CAMERA,
    IMAGES,
    INPUTS,
    LABELS,
    MANIFEST,
    SCENARIO,
    SENSORS,
    SPACECRAFT,
    TRAJECTORY,
    TRUTH,
    inside,
    sensor_file,
)
from posse_core._dataset.remarks import Remark
from posse_core._dataset.sensors import SensorInfo, write_sensor
from posse_core._dataset.spacecraft import write_spacecraft
from posse_core._errors import ComponentError, InputError, PosseError, StoreError
from posse_core._files.atomic import remove_partial, sha256, write_bytes, write_json
from posse_core._files.reading import read_bytes
from posse_core._files.store import Store, is_remote
from posse_core._files.trajectory import load_trajectory, save_trajectory
from posse_core._interfaces.executor import FrameMade
from posse_core._model.manifest import Manifest
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.loading import Plugins
from posse_core._run.destination import Destination, open_destination
from posse_core._run.exports import export_digests
from posse_core._run.inputs import Inputs, as_begun, inputs_of, write_inputs
from posse_core._run.manifest import make_manifest
from posse_core._run.shards import LabelLog, shard_path
from posse_core._scenario.component import create
from posse_core._scenario.load import dump_scenario
from posse_core._scenario.model import Scenario
from posse_core._simulator.returned import written

_UNUSABLE = {
    *(errno.EACCES, errno.EROFS, errno.EPERM),
    *(errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ELOOP, errno.ENAMETOOLONG),
}
"""Errors of a folder that cannot be written to."""


class Recording:
    """The dataset that is being made at a location. :func:`recording` opens one.

    Attributes:
        done: indices of the frames that an earlier attempt made.
        folder: the folder on this machine that holds the bookkeeping files.
    """

    def __init__(
        self,
        destination: Destination,
        inputs: Inputs,
        scene: Scene,
        sensors: Sequence[SensorInfo],
        frames: int,
        plugins: Plugins,
        trajectory: Trajectory | None,
    ) -> None:
        self._destination = destination
        self._scenario = inputs.scenario
        self._frames = frames
        self._plugins = plugins
        self.folder = destination.folder
        self._recorded = self._read_manifest()
        crafts = {SPACECRAFT: scene.spacecraft}
        crafts |= {f"{BODIES}/{body.name}": body.spacecraft for body in scene.others}
        self._refuse_strangers(crafts, sensors, inputs)
        self._write_statics(crafts, sensors)
        recorded = {} if self._recorded is None else self._recorded.sha256
        write_inputs(self.folder, inputs, recorded)
        if trajectory is not None and not self._has_trajectory(trajectory):
            save_trajectory(trajectory, self.folder / TRAJECTORY)
        self._log = LabelLog(self.folder, frames)
        self.done = self._log.recover(self.store.sha256, self.store.read_threads)

    @property
    def store(self) -> Store:
        """Where the files of frames are written."""
        return self._destination.store

    @property
    def is_complete(self) -> bool:
        """Whether an earlier attempt made every frame, and all files are as its manifest says."""
        if self._recorded is None or not self._recorded.is_complete:
            return False
        listed = {**self._recorded.sha256, **self._recorded.exports}
        return all(self._is_as_recorded(name, digest) for name, digest in listed.items())

    def begin(self) -> None:
        """Prepare for frames to come."""
        (self.folder / MANIFEST).unlink(missing_ok=True)
        self._destination.save()
        self._plugins.notify("posse_run_started", dataset=self.folder, frames=self._frames)

    def add(self, made: FrameMade) -> None:
        """Log a frame whose files are complete."""
        self._destination.frame_logged(self._log.append(made.labels, made.sha256, made.remark))
        self._plugins.notify("posse_frame_completed", index=made.labels.index, labels=made.labels)

    def remarks(self) -> Mapping[Remark, int]:
        """Remark → number of the frames so far, those of earlier attempts too, that it is made on."""
        return self._log.remarks()

    def finish(self, failed: dict[int, str], *, frames: int | None = None) -> None:
        """Sort the labels, write the exports, and then the manifest as the last file of a dataset.

        Args:
            failed: index of a frame that could not be made → why.
            frames: number of frames that the dataset has; None for as many as were planned.
        """
        self._log.put_in_order()
        dataset = Dataset(self.folder)
        registry = self._plugins.registry
        paths: list[Path] = []
        if len(dataset):
            for choice in self._scenario.writers:
                writer = create(registry, "writer", choice)
                paths += written(writer, choice.name, dataset, self.folder)
        manifest = make_manifest(
            self._destination,
            self._scenario,
            self._frames if frames is None else frames,
            self._plugins,
            failed,
            export_digests(paths, self.folder),
        )
        write_json(self.folder / MANIFEST, manifest.as_json())
        self._plugins.notify("posse_run_finished", dataset=self.folder, manifest=manifest)
        self._destination.save()

    def _write_statics(self, crafts: Mapping[str, Spacecraft], sensors: Sequence[SensorInfo]) -> None:
        """Write the files that do not depend on frames; first the scenario, which marks a dataset.

        crafts: name of a folder → the spacecraft whose files it holds.
        """
        folder = self.folder
        if not (folder / SCENARIO).exists():
            write_bytes(folder / SCENARIO, dump_scenario(self._scenario).encode())
        parts = [*crafts, IMAGES, TRUTH, LABELS]
        if sensors:
            parts += [SENSORS, *(f"{SENSORS}/{sensor.name}" for sensor in sensors)]
        for part in parts:
            (folder / part).mkdir(parents=True, exist_ok=True)
        for part in (".", *parts):
            remove_partial(folder / part)
        for sensor in sensors:
            named = replace(sensor, options=self._scenario.sensors[sensor.name].options)
            write_sensor(named, sensor_file(folder, sensor.name))
        write_camera(self._scenario.camera.camera(), folder / CAMERA)
        for part, craft in crafts.items():
            write_spacecraft(craft, folder / part)

    def _read_manifest(self) -> Manifest | None:
        """The manifest of an earlier attempt, if that has ended and the file is whole."""
        try:
            return Manifest.from_json(read_bytes(self.folder / MANIFEST))
        except InputError:
            return None

    def _has_trajectory(self, trajectory: Trajectory) -> bool:
        """Whether the trajectory is there, as the manifest says or, without one, as it was written."""
        if self._recorded is not None and TRAJECTORY in self._recorded.sha256:
            return self._is_as_recorded(TRAJECTORY, self._recorded.sha256[TRAJECTORY])
        try:
            return len(load_trajectory(self.folder / TRAJECTORY)) == len(trajectory)
        except InputError:
            return False

    def _is_as_recorded(self, name: str, digest: str) -> bool:
        try:
            return sha256(inside(self.folder, name)) == digest
        except (OSError, InputError):
            return False

    def _refuse_strangers(
        self, crafts: Mapping[str, Spacecraft], sensors: Sequence[SensorInfo], inputs: Inputs
    ) -> None:
        """Refuse files where only those of the run may be, since ``posse validate`` would find them.

        crafts: as in :meth:`_write_statics`.

        Raises:
            InputError: There is such a file; the message names it.
        """
        frames = range(self._frames)
        own = {
            IMAGES: {f"{index:06d}.png" for index in frames},
            TRUTH: {f"{index:06d}.npz" for index in frames},
            LABELS: {shard_path(self.folder, index).name for index in frames},
            BODIES: {Path(part).name for part in crafts if part != SPACECRAFT},
            **{
                part: {f"{craft.name}.{suffix}" for suffix in ("json", "ply")}
                for part, craft in crafts.items()
            },
            SENSORS: {name for sensor in sensors for name in (sensor.name, f"{sensor.name}.json")},
        }
        for part, names in own.items():
            if not (self.folder / part).is_dir():
                continue
            for name in sorted({*os.listdir(self.folder / part)} - names):
                if not name.startswith("."):
                    raise self._strange(f"{part}/{name}")
        for path in sorted((self.folder / INPUTS).rglob("[!.]*")):
            name = path.relative_to(self.folder).as_posix()
            if name not in inputs.files and not path.is_dir():
                raise self._strange(name)

    def _strange(self, name: str) -> InputError:
        return InputError(f"{self.folder}: {name} is no file of this run; move it elsewhere")


@contextlib.contextmanager
def recording(
    out: str,
    scenario: Scenario,
    scene: Scene,
    frames: int,
    plugins: Plugins,
    *,
    sensors: Sequence[SensorInfo] = (),
    trajectory: Trajectory | None = None,
    resume: bool,
) -> Iterator[Recording]:
    """Claim ``out``, a path or a URL, for the dataset of a scenario, within the block.

    If the block fails before a first frame is made, nothing is left behind.

    Args:
        out: location of the dataset.
        scenario: that the dataset is made from.
        scene: of the scenario.
        frames: the planned number of frames.
        plugins: that are installed.
        sensors: beside the camera.
        trajectory: of the frames, if it is known beforehand.
        resume: go on with the dataset that is there.

    Raises:
        InputError: The folder contains another run, is in use, or cannot be written to.
        ComponentError: The disk failed.
        StoreError: A network store refuses.
    """
    if not is_remote(out) and Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"--out {out}: is a file; choose a folder that does not exist yet")
    inputs = inputs_of(scenario)
    destination = open_destination(out)
    made_some = False
    try:
        with destination.claimed():
            fresh = _check_claim(destination, out, resume=resume)
            if not fresh:
                inputs = as_begun(destination.folder, scenario, inputs, plugins.registry, out)
            try:
                yield Recording(destination, inputs, scene, sensors, frames, plugins, trajectory)
            except (OSError, PosseError):
                made_some = not fresh or any((destination.folder / LABELS).glob("*.jsonl"))
                if not made_some:
                    destination.discard()
                raise
    except OSError as error:
        raise _explained(error, out, kept=made_some) from error
    except StoreError as error:
        raise StoreError(f"{error}{_how_to_continue(made_some)}") from None


def _check_claim(destination: Destination, out: str, *, resume: bool) -> bool:
    """Check that the destination is empty or holds a run to resume; return whether it was empty."""
    if all(path.name.startswith(".") for path in destination.folder.iterdir()):
        return True
    if not (destination.folder / SCENARIO).exists():
        raise InputError(f"--out {out}: is not empty and contains no run; choose another folder")
    if not resume:
        raise InputError(
            f"--out {out}: contains another run; choose another folder, or continue it with --resume"
        )
    return False


def _how_to_continue(kept: bool) -> str:
    return "; continue with --resume: the frames made so far are kept" if kept else ""


def _explained(error: OSError, out: str, *, kept: bool) -> PosseError:
    """Turn an error of the disk into one that says what to do."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(f"--out {out}: the disk is full; free some space{_how_to_continue(kept)}")
    if error.errno in _UNUSABLE:
        reason = (error.strerror or "").lower()
        return InputError(f"--out {out}: cannot be written to ({reason}); choose another folder")
    return ComponentError(f"{out}: {error}{_how_to_continue(kept)}")
