"""Proof of a dataset: its files, and the labels of every frame against pose, camera and mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._dataset.dataset import PARTITION_FILE, Dataset, read_image, read_json
from posse_core._errors import InputError
from posse_core._evaluation.case import Case
from posse_core._evaluation.checks import CHECKS, SCHEMA
from posse_core._evaluation.exports import check_exports
from posse_core._evaluation.motion import check_motion
from posse_core._evaluation.result import Fault, Report, Result
from posse_core._files.atomic import sha256

Progress = Callable[[Iterable[int], int], Iterable[int]]
"""Wraps the places of the frames to show how far it is: (places, how many)."""


def validate(dataset: Dataset, progress: Progress) -> Report:
    """Try every check on every frame.

    Raises:
        InputError: the run that writes the dataset has not ended.
    """
    manifest = dataset.manifest
    whole = [
        _lines(dataset),
        _frames(dataset, manifest),
        _leftovers(dataset),
        _checksums(dataset, manifest),
        _twins(dataset),
        _partition(dataset),
    ]
    schema = Result(SCHEMA.name, SCHEMA.proves)
    results = [Result(check.name, check.proves) for check in CHECKS]
    lines = dataset.label_lines
    for place in progress(range(len(lines)), len(lines)):
        case = Case(dataset, lines[place])
        index = int(lines.indices[place])
        schema.checked += 1
        faults = [Fault(index, message) for message in SCHEMA.run(case)]
        schema.faults += faults
        if faults:
            continue
        for check, result in zip(CHECKS, results, strict=True):
            if check.applies(case):
                result.checked += 1
                result.faults += [Fault(index, message) for message in check.run(case)]
    compared = [] if schema.faults else [check_motion(dataset), *check_exports(dataset)]
    return Report(dataset.folder, len(lines), (*whole, schema, *results, *compared))


def _lines(dataset: Dataset) -> Result:
    lines = dataset.label_lines
    result = Result("lines", "every label line is whole, and no frame is labelled twice", len(lines))
    result.faults = [Fault(None, f"labels/{where}: not a label") for where in lines.damaged]
    indices, counts = np.unique(lines.indices, return_counts=True)
    for index, count in zip(indices[counts > 1].tolist(), counts[counts > 1].tolist(), strict=True):
        result.faults.append(Fault(index, f"labelled {count} times"))
    return result


def _frames(dataset: Dataset, manifest: Mapping[str, Any]) -> Result:
    """The manifest says how many frames there are, and which could not be made."""
    expected, failed = manifest.get("frames"), manifest.get("failed_frames", {})
    there = set(dataset.label_lines.indices.tolist())
    result = Result("frames", "every frame of the manifest is there, and no other", len(there))
    if not isinstance(expected, int):
        result.faults.append(Fault(None, "manifest.json does not say how many 'frames' there are"))
        return result
    for index in sorted(set(range(expected)) - there):
        cause = failed.get(str(index))
        result.faults.append(Fault(index, f"could not be made: {cause}" if cause else "missing"))
    result.faults += [Fault(i, "not in the manifest") for i in sorted(there) if i >= expected]
    return result


def _leftovers(dataset: Dataset) -> Result:
    named: set[str] = set()
    for labels in dataset.label_lines:
        named.update(
            name for name in (labels.get("image"), labels.get("truth")) if isinstance(name, str)
        )
    result = Result("leftovers", "images/ and truth/ hold no file that no frame names", len(named))
    for part in ("images", "truth"):
        for path in sorted((dataset.folder / part).glob("[!.]*")):
            name = f"{part}/{path.name}"
            if name not in named:
                result.faults.append(Fault(None, f"{name}: no frame names it"))
    return result


def _checksums(dataset: Dataset, manifest: Mapping[str, Any]) -> Result:
    result = Result("checksums", "every file is as it was written")
    of_file = {
        name: labels["index"]
        for labels in dataset.label_lines
        for name in (labels.get("image"), labels.get("truth"))
        if isinstance(name, str)
    }
    expected = {**manifest.get("sha256", {}), **dataset.digests}
    for name, digest in expected.items():
        path = dataset.folder / name
        result.checked += 1
        if not path.is_file():
            result.faults.append(Fault(of_file.get(name), f"{name}: missing"))
        elif sha256(path) != digest:
            result.faults.append(Fault(of_file.get(name), f"{name}: not as it was written"))
    for name in sorted(of_file.keys() - expected.keys()):
        result.faults.append(Fault(of_file[name], f"{name}: has no checksum"))
    return result


def _twins(dataset: Dataset) -> Result:
    """Two frames of one moment and pose, or with one picture though the craft is elsewhere in it."""
    result = Result("twins", "no two frames are one and the same", len(dataset.label_lines))
    moments: dict[int, int] = {}
    pictures: dict[str, tuple[int, int]] = {}
    for labels in dataset.label_lines:
        index = labels["index"]
        pose = [labels.get("q_cam_from_body"), labels.get("t_body_cam_m")]
        moment = hash(repr([labels.get(k) for k in ("t_s", "sequence", "spacecraft")] + pose))
        other = moments.setdefault(moment, index)
        if other != index:
            result.faults.append(Fault(index, f"is of the same moment and pose as frame {other}"))
        digest = dataset.digests.get(str(labels.get("image")))
        if digest is None:
            continue
        same, its_pose = pictures.setdefault(digest, (index, hash(repr(pose))))
        if its_pose != hash(repr(pose)) and _shows_something(dataset.folder / labels["image"]):
            result.faults.append(Fault(index, f"has the same picture as frame {same}, and another pose"))
    return result


def _shows_something(path: Path) -> bool:
    try:
        image = read_image(path)
    except InputError:
        return False  # said by ``files``
    return bool(image.min() != image.max())


def _partition(dataset: Dataset) -> Result:
    result = Result("partition", "no frame, and no sequence kept whole, is in two parts")
    path = dataset.folder / PARTITION_FILE
    if not path.exists():
        return result
    partition = read_json(path)
    part_of: dict[int, str] = {}
    for part, indices in partition["parts"].items():
        for index in indices:
            result.checked += 1
            if part_of.setdefault(index, part) != part:
                result.faults.append(Fault(index, f"is in {part_of[index]} and in {part}"))
    there = set(dataset.label_lines.indices.tolist())
    result.faults += [
        Fault(i, "is in a part, and not in the dataset") for i in sorted(set(part_of) - there)
    ]
    result.faults += [Fault(i, "is in no part") for i in sorted(there - set(part_of))]
    if partition.get("by") == "sequence":
        result.faults += _leaks(dataset, part_of)
    return result


def _leaks(dataset: Dataset, part_of: Mapping[int, str]) -> Iterator[Fault]:
    home: dict[Any, str] = {}
    for labels in dataset.label_lines:
        part = part_of.get(labels["index"])
        sequence = labels.get("sequence")
        if part is not None and home.setdefault(sequence, part) != part:
            yield Fault(labels["index"], f"sequence {sequence} is in {home[sequence]} and in {part}")
