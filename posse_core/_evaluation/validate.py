"""Proof of a dataset: its files, and the labels of every frame against pose, camera and mesh."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import (
    BODIES,
    IMAGES,
    INPUTS,
    LABELS,
    PARTITION_FILE,
    SENSORS,
    TRUTH,
    inside,
)
from posse_core._errors import InputError
from posse_core._evaluation.agreement import check_camera, check_scenario, check_spacecraft
from posse_core._evaluation.body_checks import BodyCheck
from posse_core._evaluation.case import POSE, Case
from posse_core._evaluation.checks import CHECKS, SCHEMA, Check
from posse_core._evaluation.export_again import check_exports_again
from posse_core._evaluation.exports import check_exports
from posse_core._evaluation.motion import check_motion
from posse_core._evaluation.motion_checks import MOTION_CHECKS
from posse_core._evaluation.pictures import PictureChecks
from posse_core._evaluation.result import Fault, Report, Result
from posse_core._evaluation.scenarios import Scenarios
from posse_core._evaluation.sensors import SensorChecks
from posse_core._evaluation.sunlight import SUNLIGHT
from posse_core._files.atomic import sha256
from posse_core._files.reading import parsed_json, read_text
from posse_core._model.label_line import BodyLabels, LabelLine
from posse_core._model.manifest import Manifest
from posse_core._selection.partition import By, partition

_READING_FILE = re.compile(rf'"({SENSORS}/[^"]+)"')

Progress = Callable[[Iterable[int], int], Iterable[int]]
"""Wraps the positions of the frames to show progress: (positions, how many)."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """What the checks of the whole dataset compare of one label line.

    Attributes:
        labels_fault: why the line is not one; then there is no more than its index and files.
        files: image, and arrays.
        pose, moment: equal for frames of one pose of the target; of one time, spacecraft, and poses and
            joints of all bodies.
    """

    index: int
    labels_fault: str | None = None
    files: tuple[str, ...] = ()
    sequence: int | None = None
    pose: int | None = None
    moment: int | None = None


def validate(dataset: Dataset, progress: Progress) -> Report:
    """Try every check on every frame.

    Raises:
        InputError: the run that writes the dataset has not ended.
    """
    manifest = dataset.manifest
    lines = dataset.label_lines
    frames = [_frame(int(i), line) for i, line in zip(lines.indices, lines, strict=True)]
    whole = [
        _lines(dataset),
        _frames(dataset, manifest),
        _leftovers(dataset, manifest, frames),
        _checksums(dataset, manifest, frames),
        _twins(dataset, frames),
        _partition(dataset, frames),
    ]
    schema = Result(SCHEMA.name, SCHEMA.proves)
    checks: tuple[Check | BodyCheck, ...] = (*CHECKS, SUNLIGHT, *MOTION_CHECKS)
    results = [Result(check.name, check.proves) for check in checks]
    sensors = SensorChecks(dataset)
    scenarios = Scenarios(dataset)
    pictures = PictureChecks(scenarios)
    for position in progress(range(len(lines)), len(lines)):
        frame = frames[position]
        schema.checked += 1
        if frame.labels_fault is not None:
            schema.faults.append(Fault(frame.index, frame.labels_fault))
            continue
        case = Case(dataset, LabelLine.from_json(lines[position]))
        faults = [Fault(frame.index, message) for message in SCHEMA.run(case)]
        schema.faults += faults
        if faults:
            continue
        for check, result in zip(checks, results, strict=True):
            if check.applies(case):
                result.checked += 1
                result.faults += [Fault(frame.index, message) for message in check.run(case)]
        sensors.check(case.labels)
        pictures.check(case)
    is_sound = not (schema.faults or whole[0].faults)
    compared = _compared(dataset, scenarios) if is_sound else []
    return Report(
        dataset.folder,
        len(lines),
        (*whole, schema, *results, *pictures.results, *sensors.results, *compared),
    )


def _compared(dataset: Dataset, scenarios: Scenarios) -> list[Result]:
    """Checks of the whole dataset whose label lines are right."""
    exports = check_exports(dataset)
    sound = frozenset(result.name for result in exports if not result.faults)
    return [
        check_camera(dataset),
        check_spacecraft(dataset, scenarios),
        check_scenario(dataset, scenarios),
        check_motion(dataset),
        *exports,
        *check_exports_again(dataset, sound),
    ]


def _frame(index: int, line: bytes) -> _Frame:
    try:
        labels = LabelLine.from_json(line)
    except InputError as error:
        return _Frame(index, str(error), _files_named(line))
    pose = hash(_pose_of(labels))
    beside = labels.bodies if labels.has("bodies") else {}
    moving = tuple((name, _pose_of(body), _joints_of(body)) for name, body in beside.items())
    moment = hash((labels.t_s, labels.sequence, labels.spacecraft, pose, _joints_of(labels), moving))
    return _Frame(index, None, labels.files, labels.sequence, pose, moment)


def _pose_of(labels: BodyLabels) -> tuple[object, ...]:
    return tuple(getattr(labels, name) if labels.has(name) else None for name in POSE)


def _joints_of(labels: BodyLabels) -> tuple[tuple[str, float], ...]:
    joints = labels.joints if labels.has("joints") else {}
    return tuple((name, joint.value) for name, joint in joints.items())


def _files_named(line: bytes) -> tuple[str, ...]:
    """The files of a line that is at fault elsewhere."""
    try:
        values = parsed_json(line, LABELS)
    except InputError:
        return ()
    own = (values.get("image"), values.get("truth")) if isinstance(values, dict) else ()
    return (*(x for x in own if isinstance(x, str)), *_READING_FILE.findall(line.decode()))


def _lines(dataset: Dataset) -> Result:
    lines = dataset.label_lines
    result = Result("lines", "every label line is whole, and no frame is labelled twice", len(lines))
    result.faults = [Fault(None, f"{LABELS}/{where}: not a label") for where in lines.damaged]
    indices, counts = np.unique(lines.indices, return_counts=True)
    for index, count in zip(indices[counts > 1].tolist(), counts[counts > 1].tolist(), strict=True):
        result.faults.append(Fault(index, f"labelled {count} times"))
    return result


def _frames(dataset: Dataset, manifest: Manifest) -> Result:
    """The manifest says how many frames there are, and which could not be made."""
    there = set(dataset.label_lines.indices.tolist())
    result = Result("frames", "every frame of the manifest is there, and no other", len(there))
    for index in sorted(set(range(manifest.frames)) - there):
        cause = manifest.failed_frames.get(index)
        result.faults.append(Fault(index, f"could not be made: {cause}" if cause else "missing"))
    result.faults += [Fault(i, "not in the manifest") for i in sorted(there) if i >= manifest.frames]
    return result


def _leftovers(dataset: Dataset, manifest: Manifest, frames: Sequence[_Frame]) -> Result:
    named = {name for frame in frames for name in frame.files}
    proves = "no image, array or reading is there that no frame names, and no input that no run copied"
    result = Result("leftovers", proves, len(named))
    readings = [f"{SENSORS}/{path.name}" for path in sorted((dataset.folder / SENSORS).glob("*/"))]
    for part in (IMAGES, TRUTH, *readings):
        for path in sorted((dataset.folder / part).glob("[!.]*")):
            name = f"{part}/{path.name}"
            if name not in named:
                result.faults.append(Fault(None, f"{name}: no frame names it"))
    copied = [(dataset.folder / part).rglob("[!.]*") for part in (BODIES, INPUTS)]
    for path in sorted(chain(*copied)):
        name = path.relative_to(dataset.folder).as_posix()
        if name not in manifest.sha256 and not path.is_dir():
            result.faults.append(Fault(None, f"{name}: the manifest does not name it"))
    return result


def _checksums(dataset: Dataset, manifest: Manifest, frames: Sequence[_Frame]) -> Result:
    result = Result("checksums", "every file is as it was written")
    of_file = {name: frame.index for frame in frames for name in frame.files}
    expected = {**manifest.sha256, **manifest.exports, **dataset.digests}
    for name, digest in expected.items():
        path = inside(dataset.folder, name)
        result.checked += 1
        if not path.is_file():
            result.faults.append(Fault(of_file.get(name), f"{name}: missing"))
        elif sha256(path) != digest:
            result.faults.append(Fault(of_file.get(name), f"{name}: not as it was written"))
    for name in sorted(of_file.keys() - expected.keys()):
        result.faults.append(Fault(of_file[name], f"{name}: has no checksum"))
    return result


def _twins(dataset: Dataset, frames: Sequence[_Frame]) -> Result:
    """Two frames of one moment and pose, or with one picture though the craft is elsewhere in it."""
    result = Result("twins", "no two frames are one and the same", len(frames))
    moments: dict[int, int] = {}
    pictures: dict[str, tuple[int, int]] = {}
    for frame in frames:
        if frame.moment is None or frame.pose is None:
            continue
        other = moments.setdefault(frame.moment, frame.index)
        if other != frame.index:
            result.faults.append(Fault(frame.index, f"is of the same moment and pose as frame {other}"))
        image = frame.files[0]
        digest = dataset.digests.get(image)
        if digest is None:
            continue
        same, its_pose = pictures.setdefault(digest, (frame.index, frame.pose))
        if its_pose != frame.pose and _shows_something(dataset.folder / image):
            result.faults.append(
                Fault(frame.index, f"has the same picture as frame {same}, and another pose")
            )
    return result


def _shows_something(path: Path) -> bool:
    try:
        image = read_image(path)
    except InputError:
        return False  # said by ``files``
    return bool(image.min() != image.max())


def _partition(dataset: Dataset, frames: Sequence[_Frame]) -> Result:
    result = Result("partition", "no frame, and no sequence kept whole, is in two parts")
    if not dataset.is_divided:
        return result
    divided = dataset.partition
    part_of: dict[int, str] = {}
    for part, indices in divided.parts.items():
        for index in indices:
            result.checked += 1
            if part_of.setdefault(index, part) != part:
                result.faults.append(Fault(index, f"is in {part_of[index]} and in {part}"))
    there = set(dataset.label_lines.indices.tolist())
    result.faults += [
        Fault(i, "is in a part, and not in the dataset") for i in sorted(set(part_of) - there)
    ]
    result.faults += [Fault(i, "is in no part") for i in sorted(there - set(part_of))]
    if divided.by == "sequence":
        result.faults += _leaks(frames, part_of)
    if not result.faults:
        result.faults += [Fault(None, text) for text in _redivided(dataset, frames)]
    return result


def _redivided(dataset: Dataset, frames: Sequence[_Frame]) -> Iterator[str]:
    """The parts are those that seed and shares give, and the lists beside are of their images."""
    divided = dataset.partition
    if divided.seed is not None and divided.shares is not None:
        sequences = np.array([-1 if frame.sequence is None else frame.sequence for frame in frames])
        by: By = "sequence" if divided.by == "sequence" else "frame"
        expected = partition(dataset.indices, sequences, divided.shares, divided.seed, by)
        for part, indices in expected.items():
            if list(divided.parts.get(part, ())) != indices:
                yield f"{part} is not the part that seed {divided.seed} and the shares give"
    image_of = {frame.index: frame.files[0] for frame in frames if frame.files}
    for part, members in divided.parts.items():
        for kind in ("images", "pose"):
            path = (dataset.folder / PARTITION_FILE).parent / f"{part}_{kind}.csv"
            if path.is_file():
                rows = read_text(path).splitlines()[1:]
                if [row.split(",")[0] for row in rows] != [image_of.get(i) for i in members]:
                    yield f"partition/{path.name} does not list the images of {part}"


def _leaks(frames: Sequence[_Frame], part_of: Mapping[int, str]) -> Iterator[Fault]:
    home: dict[int | None, str] = {}
    for frame in frames:
        part, sequence = part_of.get(frame.index), frame.sequence
        if part is not None and home.setdefault(sequence, part) != part:
            yield Fault(frame.index, f"sequence {sequence} is in {home[sequence]} and in {part}")
