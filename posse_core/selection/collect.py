"""One dataset out of several, less the frames that rules drop (the thesis' ``generator.py``)."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from posse_core import __version__
from posse_core.dataset import Dataset
from posse_core.environment.time import SECONDS_PER_DAY, Epoch
from posse_core.errors import InputError
from posse_core.files import sha256, write_json
from posse_core.formats.images import place
from posse_core.model.trajectory import Trajectory
from posse_core.pipeline.shards import CHECKSUMS, LabelLog
from posse_core.selection.rules import Rule, first_that_drops
from posse_core.trajectory import load_trajectory, save_trajectory

_ARRAYS = tuple(field.name for field in fields(Trajectory) if field.name != "epoch_utc")

Progress = Callable[[Iterable[dict[str, Any]], int], Iterable[dict[str, Any]]]
"""Wraps the labels of a dataset's frames to show how far it is: (labels, how many)."""


def collect(
    sources: Sequence[Dataset], rules: Sequence[Rule], out: Path, progress: Progress
) -> Counter[str]:
    """Write the frames that no rule drops as one dataset, numbered anew in the order of the sources.

    Times count from the first source's epoch; sequences are numbered on. A label line keeps where it
    came from as ``origin: [folder, index]``. Files are linked where that can be done.

    Returns:
        Frames by rule that dropped them, and ``kept``.

    Raises:
        InputError: the folder exists, the sources' cameras or spacecraft differ, a file is not as it
            was written, or no frame is left; nothing is written then.
    """
    if out.exists():
        raise InputError(f"{out}: exists already; name a new folder")
    _check_alike(sources)
    out.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}."))
    try:
        counts = _build(sources, rules, building, out, progress)
        building.chmod(0o755)
        building.rename(out)
    except BaseException:
        shutil.rmtree(building, ignore_errors=True)
        raise
    return counts


def _check_alike(sources: Sequence[Dataset]) -> None:
    first = sources[0]
    meshes: dict[str, tuple[str, Dataset]] = {}
    for dataset in sources:
        if dataset.manifest.get("state") != "complete":
            raise InputError(
                f"{dataset.folder}: has frames that could not be made; run it with --resume"
            )
        if dataset.camera != first.camera:
            raise InputError(f"{dataset.folder}: its camera is not that of {first.folder}")
        for name in dataset.spacecraft_by_name:
            files = (dataset.folder / "spacecraft" / f"{name}.{kind}" for kind in ("json", "ply"))
            digest = " ".join(sha256(path) for path in files)
            known, other = meshes.setdefault(name, (digest, dataset))
            if known != digest:
                raise InputError(f"{dataset.folder}: its {name!r} is not that of {other.folder}")


def _build(
    sources: Sequence[Dataset], rules: Sequence[Rule], folder: Path, out: Path, progress: Progress
) -> Counter[str]:
    for name in ("images", "truth", "spacecraft"):
        (folder / name).mkdir()
    log = LabelLog(folder, sum(len(dataset.frames) for dataset in sources))
    counts: Counter[str] = Counter({rule.name: 0 for rule in rules})
    trajectories: list[Trajectory] = []
    records: list[dict[str, Any]] = []
    epoch: Epoch | None = None
    first_sequence = 0
    for number, dataset in enumerate(sources):
        trajectory = load_trajectory(dataset.folder / "trajectory.npz")
        epoch = epoch or Epoch.from_iso(trajectory.epoch_utc)
        later_s = _seconds_between(epoch, Epoch.from_iso(trajectory.epoch_utc))
        kept: list[int] = []
        for labels in progress(dataset.frames, len(dataset.frames)):
            rule = first_that_drops(rules, dataset, labels)
            counts["kept" if rule is None else rule.name] += 1
            if rule is None:
                kept.append(labels["index"])
                _take(dataset, labels, folder, counts["kept"] - 1, first_sequence, later_s, log)
        sequences = trajectory.sequence + first_sequence
        first_sequence = int(sequences.max()) + 1
        moved = replace(trajectory, t_s=trajectory.t_s + later_s, sequence=sequences)
        trajectories.append(_rows(moved, kept))
        records.append(_record(dataset, number, folder))
    if counts["kept"] == 0:
        raise InputError(f"{out}: no frame is left by {', '.join(rule.name for rule in rules)}")
    save_trajectory(_joined(trajectories), folder / "trajectory.npz")
    shutil.copyfile(sources[0].folder / "camera.json", folder / "camera.json")
    _write_manifest(folder, records, counts, rules)
    return counts


def _take(
    dataset: Dataset,
    labels: dict[str, Any],
    folder: Path,
    index: int,
    first_sequence: int,
    later_s: float,
    log: LabelLog,
) -> None:
    taken = {
        **labels,
        "index": index,
        "t_s": labels["t_s"] + later_s,
        "sequence": labels["sequence"] + first_sequence,
        "origin": [dataset.folder.resolve().name, labels["index"]],
    }
    for key in ("image", "truth"):
        if labels[key] is not None:
            source = dataset.folder / labels[key]
            if not source.is_file() or dataset.digests.get(labels[key]) != sha256(source):
                raise InputError(f"{source}: missing, or not as it was written; see 'posse validate'")
            taken[key] = f"{Path(labels[key]).parent}/{index:06d}{source.suffix}"
            place(source, folder / taken[key])
    log.append(taken)


def _seconds_between(start: Epoch, end: Epoch) -> float:
    zero = np.zeros(())
    (a1, a2), (b1, b2) = start.tt(zero), end.tt(zero)
    return float(((b1 - a1) + (b2 - a2)) * SECONDS_PER_DAY)


def _rows(trajectory: Trajectory, rows: list[int]) -> Trajectory:
    arrays = {
        f.name: getattr(trajectory, f.name)[rows] for f in fields(trajectory) if f.name != "epoch_utc"
    }
    return replace(trajectory, **arrays)


def _joined(trajectories: Sequence[Trajectory]) -> Trajectory:
    arrays = {name: np.concatenate([getattr(each, name) for each in trajectories]) for name in _ARRAYS}
    return Trajectory(epoch_utc=trajectories[0].epoch_utc, **arrays)


def _record(dataset: Dataset, number: int, folder: Path) -> dict[str, Any]:
    """Copy what a source was made from; returns what the manifest says of it."""
    for name in dataset.spacecraft_by_name:
        for kind in ("json", "ply"):
            file = f"spacecraft/{name}.{kind}"
            shutil.copyfile(dataset.folder / file, folder / file)
    scenario = dataset.folder / "scenario.yaml"
    copy = f"scenario-{number}.yaml"
    if scenario.exists():
        shutil.copyfile(scenario, folder / copy)
    keys = ("frames", "seed", "renderer", "versions", "sources")
    return {
        "dataset": dataset.folder.resolve().name,
        "scenario": copy if scenario.exists() else None,
        **{key: dataset.manifest[key] for key in keys if key in dataset.manifest},
    }


def _write_manifest(
    folder: Path, records: list[dict[str, Any]], counts: Counter[str], rules: Sequence[Rule]
) -> None:
    files = [path for path in sorted(folder.glob("*")) if path.is_file() and path.name != CHECKSUMS]
    files += sorted([*folder.glob("spacecraft/*"), *folder.glob("labels/*")])
    manifest = {
        "format": "posse-dataset",
        "format_version": 1,
        "state": "complete",
        "frames": counts["kept"],
        "failed_frames": {},
        "versions": {"posse-core": __version__},
        "sources": records,
        "selection": [
            {"rule": rule.name, "why": rule.why, "dropped": counts[rule.name]} for rule in rules
        ],
        "sha256": {str(path.relative_to(folder)): sha256(path) for path in files},
        "frame_checksums": CHECKSUMS,
    }
    write_json(folder / "manifest.json", manifest)
