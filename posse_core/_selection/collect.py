"""Joining datasets into one, without the frames that rules drop (the thesis' ``generator.py``).

The joined dataset can be balanced.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from posse_core import __version__
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
    SOURCES,
    SPACECRAFT,
    TRAJECTORY,
    TRUTH,
    inside,
    reading_file,
    sensor_file,
)
from posse_core._environment.time import SECONDS_PER_DAY, Epoch
from posse_core._errors import InputError
from posse_core._files.atomic import sha256, write_json
from posse_core._files.trajectory import save_trajectory
from posse_core._formats.images import link_or_copy
from posse_core._model.label_line import LabelLine
from posse_core._model.manifest import (
    CHECKSUMS,
    FORMAT,
    FORMAT_VERSION,
    Manifest,
    Selection,
    Source,
)
from posse_core._model.trajectory import PLANE_TURN, Trajectory
from posse_core._run.shards import LabelLog
from posse_core._selection.balance import Balance, Bin, balanced
from posse_core._selection.rules import Rule, first_that_drops

Progress = Callable[[Iterable[LabelLine], int], Iterable[LabelLine]]
"""Wraps the labels of a dataset's frames to show the progress: (labels, number of frames)."""


BALANCE, KEPT = "balance", "kept"
"""Keys among the counts by rule: frames dropped by balancing, and frames kept."""


@dataclass(frozen=True)
class Choice:
    """The frames that are kept.

    Attributes:
        kept: for each source, the indices of its kept frames, ascending.
        dropped: number of frames dropped by each rule and by balancing.
        selection: the same for the manifest, with reasons and bins.
    """

    kept: Sequence[Sequence[int]]
    dropped: Mapping[str, int]
    selection: Sequence[Selection]


def collect(
    sources: Sequence[Dataset],
    rules: Sequence[Rule],
    balance: Balance | None,
    out: Path,
    progress: Progress,
) -> dict[str, int]:
    """Write the frames that no rule drops as one dataset, with new indices in the order of the sources.

    Times count from the first source's epoch; sequences are numbered consecutively. A label line has its
    origin as ``origin: [folder, index]``. Files are hard links where possible.

    Args:
        sources: the datasets.
        rules: by which frames are dropped.
        balance: applied to the frames that the rules leave; None keeps all of these.
        out: the new folder.
        progress: shows the progress.

    Returns:
        The number of frames dropped by each rule, and of those kept (:data:`KEPT`).

    Raises:
        InputError: The folder exists, the sources' cameras or spacecraft differ, a file has changed
        since
            it was written, or no frame is left. Nothing is written then.
    """
    if out.exists():
        raise InputError(f"{out}: exists already; choose a new folder")
    _check_alike(sources)
    choice = _choose(sources, rules, balance, progress)
    kept = sum(map(len, choice.kept))
    if kept == 0:
        raise InputError(f"{out}: no frame is left after {', '.join(rule.name for rule in rules)}")
    out.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}."))
    try:
        _build(sources, choice, building, progress)
        building.chmod(0o755)
        building.rename(out)
    except BaseException:
        shutil.rmtree(building, ignore_errors=True)
        raise
    return {**choice.dropped, KEPT: kept}


def _choose(
    sources: Sequence[Dataset], rules: Sequence[Rule], balance: Balance | None, progress: Progress
) -> Choice:
    dropped = {rule.name: 0 for rule in rules}
    left: list[tuple[int, int]] = []
    bins: list[Bin] = []
    for number, dataset in enumerate(sources):
        for labels in progress(dataset, len(dataset)):
            rule = first_that_drops(rules, dataset, labels)
            if rule is not None:
                dropped[rule.name] += 1
                continue
            left.append((number, labels.index))
            if balance is not None:
                bins.append(balance.bin_of(str(dataset.folder), labels))
    selection = [Selection(rule=r.name, why=r.why, dropped=dropped[r.name]) for r in rules]
    if balance is not None:
        positions = balanced(bins, balance.frames, balance.seed)
        dropped[BALANCE] = len(left) - len(positions)
        counts = list(balance.counts(bins, positions))
        selection.append(Selection(rule=BALANCE, why=balance.why, dropped=dropped[BALANCE], bins=counts))
        left = [left[position] for position in positions]
    kept = [[index for source, index in left if source == number] for number in range(len(sources))]
    return Choice(kept, dropped, selection)


def _check_alike(sources: Sequence[Dataset]) -> None:
    first = sources[0]
    meshes: dict[str, tuple[str, Dataset]] = {}
    for dataset in sources:
        if not dataset.manifest.is_complete:
            raise InputError(
                f"{dataset.folder}: has frames that could not be made; run it with --resume"
            )
        if dataset.camera != first.camera:
            raise InputError(f"{dataset.folder}: its camera is not that of {first.folder}")
        if _sensors(dataset) != _sensors(first):
            raise InputError(f"{dataset.folder}: its sensors are not those of {first.folder}")
        for name, files in _crafts(dataset).items():
            digest = " ".join(sha256(dataset.folder / file) for file in files)
            known, other = meshes.setdefault(name, (digest, dataset))
            if known != digest:
                raise InputError(f"{dataset.folder}: its {name} is not that of {other.folder}")


def _crafts(dataset: Dataset) -> dict[str, tuple[str, ...]]:
    """Each spacecraft and each body, in words → its files, relative to the dataset's folder."""
    folders = {f"{name!r}": (SPACECRAFT, name) for name in dataset.spacecraft_by_name}
    folders |= {f"body {name!r}": (f"{BODIES}/{name}", x.name) for name, x in dataset.bodies.items()}
    return {
        words: tuple(f"{folder}/{name}{ending}" for ending in (".json", ".ply"))
        for words, (folder, name) in folders.items()
    }


_OF_SENSORS = f"{INPUTS}/{SENSORS}."
"""What the names of sensors' inputs begin with."""


def _sensors(dataset: Dataset) -> dict[str, str]:
    """Each sensor's description, and each file that one names → its digest."""
    digests = {name: sha256(sensor_file(dataset.folder, name)) for name in dataset.sensors}
    named = dataset.manifest.sha256
    return digests | {name: named[name] for name in named if name.startswith(_OF_SENSORS)}


def _build(sources: Sequence[Dataset], choice: Choice, folder: Path, progress: Progress) -> None:
    for name in (IMAGES, TRUTH):
        (folder / name).mkdir()
    for name in sources[0].sensors:
        (folder / SENSORS / name).mkdir(parents=True)
        shutil.copyfile(sensor_file(sources[0].folder, name), sensor_file(folder, name))
    _take_inputs(sources[0], _OF_SENSORS, folder)
    frames = sum(map(len, choice.kept))
    log = LabelLog(folder, frames)
    trajectories: list[Trajectory] = []
    records: list[Source] = []
    epoch: Epoch | None = None
    index = first_sequence = 0
    for number, (dataset, kept) in enumerate(zip(sources, choice.kept, strict=True)):
        trajectory = dataset.trajectory
        epoch = epoch or Epoch.from_iso(trajectory.epoch_utc)
        later_s = _seconds_between(epoch, Epoch.from_iso(trajectory.epoch_utc))
        frames_kept = (dataset[dataset.position(frame)] for frame in kept)
        for labels in progress(frames_kept, len(kept)):
            _take(dataset, labels, folder, index, first_sequence, later_s, log)
            index += 1
        sequences = trajectory.sequence + first_sequence
        first_sequence = int(sequences.max()) + 1
        moved = replace(trajectory, t_s=trajectory.t_s + later_s, sequence=sequences)
        trajectories.append(moved.rows(np.array(kept, dtype=np.int64)))
        records.append(_record(dataset, f"{SOURCES}/{number}", folder))
    save_trajectory(_joined(trajectories), folder / TRAJECTORY)
    shutil.copyfile(sources[0].folder / CAMERA, folder / CAMERA)
    _write_manifest(folder, records, frames, choice)


def _take(
    dataset: Dataset,
    labels: LabelLine,
    folder: Path,
    index: int,
    first_sequence: int,
    later_s: float,
    log: LabelLog,
) -> None:
    changed: dict[str, Any] = {
        "index": index,
        "t_s": labels.t_s + later_s,
        "sequence": labels.sequence + first_sequence,
        "origin": (dataset.folder.resolve().name, labels.index),
    }
    digests: dict[str, str] = {}

    def taken(name: str, new: str) -> str:
        """Take a file under a new name."""
        link_or_copy(_unchanged(dataset, name, dataset.digests.get(name)), folder / new)
        digests[new] = dataset.digests[name]
        return new

    for key, name in (("image", labels.image), ("truth", labels.truth)):
        if name is not None:
            changed[key] = taken(name, f"{Path(name).parent}/{index:06d}{Path(name).suffix}")
    if labels.has("sensors"):
        changed["sensors"] = {
            sensor: tuple(
                reading.model_copy(
                    update={
                        "t_s": reading.t_s + later_s,
                        "files": tuple(
                            taken(name, reading_file(sensor, index, number, Path(name).suffix))
                            for name in reading.files
                        ),
                    }
                )
                for number, reading in enumerate(readings)
            )
            for sensor, readings in labels.sensors.items()
        }
    log.append(labels.model_copy(update=changed), digests)


def _take_inputs(dataset: Dataset, prefix: str, folder: Path) -> None:
    """Take the files among a source's inputs whose names begin with a text."""
    for name, digest in dataset.manifest.sha256.items():
        if name.startswith(prefix):
            target = inside(folder, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            link_or_copy(_unchanged(dataset, name, digest), target)


def _unchanged(dataset: Dataset, name: str, digest: str | None) -> Path:
    """The path of a source's file, after a check of its digest."""
    source = inside(dataset.folder, name)
    if not source.is_file() or digest != sha256(source):
        raise InputError(f"{source}: missing, or changed since it was written; see 'posse validate'")
    return source


def _seconds_between(start: Epoch, end: Epoch) -> float:
    zero = np.zeros(())
    (a1, a2), (b1, b2) = start.tt(zero), end.tt(zero)
    return float(((b1 - a1) + (b2 - a2)) * SECONDS_PER_DAY)


def _joined(trajectories: Sequence[Trajectory]) -> Trajectory:
    """Join trajectories into one, with those extras that all of them have. The turn of the orbit's plane
    is 0 where it is not said, so it is kept if any has it."""
    if any(PLANE_TURN in each.extras for each in trajectories):
        trajectories = [
            replace(each, extras={**each.extras, PLANE_TURN: each.plane_turn_rad_s})
            for each in trajectories
        ]
    first, *others = trajectories
    arrays = {
        name: np.concatenate([each.arrays()[name] for each in trajectories]) for name in first.arrays()
    }
    extras = {
        name: np.concatenate([each.extras[name] for each in trajectories])
        for name, array in first.extras.items()
        if all(name in x.extras and x.extras[name].shape[1:] == array.shape[1:] for x in others)
    }
    return Trajectory(epoch_utc=first.epoch_utc, **arrays, extras=extras)


def _record(dataset: Dataset, part: str, folder: Path) -> Source:
    """Copy the spacecraft and the bodies of a source, and, into a folder of their own, its scenario with
    inputs.

    Returns:
        Its record for the manifest.
    """
    for files in _crafts(dataset).values():
        for name in files:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(dataset.folder / name, folder / name)
    scenario = dataset.folder / SCENARIO
    copy = f"{part}/{SCENARIO}"
    if scenario.exists():
        (folder / part).mkdir(parents=True)
        shutil.copyfile(scenario, folder / copy)
        _take_inputs(dataset, f"{INPUTS}/", folder / part)
    said = dataset.manifest.model_dump(
        include={"frames", "seed", "renderer", "versions", "sources"}, exclude_unset=True
    )
    return Source(
        dataset=dataset.folder.resolve().name, scenario=copy if scenario.exists() else None, **said
    )


def _write_manifest(folder: Path, records: list[Source], frames: int, choice: Choice) -> None:
    files = [path for path in sorted(folder.glob("*")) if path.is_file() and path.name != CHECKSUMS]
    statics = (f"{SPACECRAFT}/*", f"{BODIES}/*/*", f"{SENSORS}/*.json", f"{INPUTS}/**/*")
    for pattern in (*statics, f"{SOURCES}/**/*", f"{LABELS}/*"):
        files += (path for path in sorted(folder.glob(pattern)) if path.is_file())
    manifest = Manifest(
        format=FORMAT,
        format_version=FORMAT_VERSION,
        state="complete",
        frames=frames,
        failed_frames={},
        versions={"posse-core": __version__},
        sources=records,
        selection=list(choice.selection),
        sha256={path.relative_to(folder).as_posix(): sha256(path) for path in files},
        frame_checksums=CHECKSUMS,
    )
    write_json(folder / MANIFEST, manifest.as_json())
