"""Checks of the readings of sensors beside the camera."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from posse_core import _frames as frames
from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import sensor_file
from posse_core._dataset.readings import read_reading
from posse_core._dataset.sensors import SensorInfo
from posse_core._errors import InputError
from posse_core._evaluation.case import ARRAYS, Case
from posse_core._evaluation.checks import CHECKS, SCHEMA
from posse_core._evaluation.raster import RayMeeting
from posse_core._evaluation.result import Fault, Result
from posse_core._interfaces.sensor import Sensor, StoredReading
from posse_core._model.label_line import LabelLine, ReadingLabels, first_fault
from posse_core._model.reading import Reading
from posse_core._plugins.component import failures_named
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.files import anchored, with_files
from posse_core._scenario.yaml_lines import KeyPath

MOUNT_ERROR = 1e-9
"""How far the attitude at a frame's instant may be from the frame's by the mount, rad, and the position,
over the range."""
_OF_THE_FRAME = ("index", "t_s", "epoch_utc", "sequence", "spacecraft")
_OF_A_CAMERA = ("q_cam_from_body", "t_body_cam_m", "box_visible_px", "mask_rle", "keypoints")
"""Labels of which a reading has one if the scenario's annotators labelled it."""


class SensorChecks:
    """The checks of every sensor of a dataset, a result for each."""

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._results: dict[str, Result] = {}
        self._components: dict[str, Sensor[Any]] = {}
        if not dataset.sensors:
            return
        registry = load_plugins().registry
        for name, info in dataset.sensors.items():
            result = Result(f"sensor {name}", "readings fit pose, mount and mesh")
            self._results[name] = result
            try:
                options = registry.options("sensor", info.type, info.options)
                options = with_files(options, partial(self._file, name))
                self._components[name] = registry.create("sensor", info.type, options)
            except InputError as error:
                result.proves = f"only pose and files were checked: {error}"

    def _file(self, name: str, key: KeyPath, path: Path) -> Path:
        where = f"{sensor_file(self._dataset.folder, name)}: {'.'.join(map(str, key))}"
        return anchored(path, self._dataset.folder, where, confined=True)

    @property
    def results(self) -> Sequence[Result]:
        """What was found so far."""
        return tuple(self._results.values())

    def check(self, labels: LabelLine) -> None:
        """Check the readings of a frame whose label line is right."""
        taken = labels.sensors if labels.has("sensors") else {}
        for name in taken.keys() - self._results.keys():
            self._results[name] = Result(f"sensor {name}", "it is described in sensors/")
            self._results[name].faults.append(Fault(labels.index, "has no description"))
        for name, info in self._dataset.sensors.items():
            result = self._results[name]
            result.checked += 1
            if name not in taken:
                result.faults.append(Fault(labels.index, "the frame has no reading of it"))
                continue
            for number, reading in enumerate(taken[name]):
                for message in self._faults(info, labels, reading, number):
                    result.faults.append(Fault(labels.index, f"reading {number}: {message}"))

    def _faults(
        self, info: SensorInfo, labels: LabelLine, said: ReadingLabels, number: int
    ) -> Iterator[str]:
        try:
            reading = read_reading(self._dataset.folder, said)
        except InputError as error:
            yield str(error)
            return
        q = np.array(said.q_sensor_from_body)
        if abs(np.linalg.norm(q) - 1) > MOUNT_ERROR or q[0] < 0:
            yield "q_sensor_from_body is not a unit quaternion with a scalar part of at least 0"
            return
        if number == 0:
            yield from _mounted(info, labels, said)
        case = ReadingCase(self._dataset, info, labels, said, reading)
        if info.camera is not None and any(name in said.labels for name in _OF_A_CAMERA):
            yield from _as_a_frame(case, said)
        component = self._components.get(info.name)
        if component is not None:
            stored = StoredReading(
                index=labels.index,
                labels=said,
                reading=reading,
                camera=info.camera,
                mount=info.mount,
                parts=case.craft.parts,
                distances_m=case.distances_m,
            )
            with failures_named("sensor", info.type):
                yield from component.faults(stored)


class ReadingCase(Case):
    """A reading under test in the place of a frame, the sensor in that of the dataset's camera.

    Attributes:
        labels_fault: why the reading's labels are not those of a frame, or None.
    """

    def __init__(
        self,
        dataset: Dataset,
        info: SensorInfo,
        frame: LabelLine,
        said: ReadingLabels,
        reading: Reading,
    ) -> None:
        """frame: labels of the frame that the reading is beside."""
        placed = {
            **{key: getattr(frame, key) for key in _OF_THE_FRAME},
            "q_cam_from_body": said.q_sensor_from_body,
            "t_body_cam_m": said.t_body_sensor_m,
            "v_body_cam_m_s": said.v_body_sensor_m_s,
            "omega_body_rad_s": said.omega_body_rad_s,
            "omega_camera_rad_s": said.omega_sensor_rad_s,
        }
        own = {key: value for key, value in said.labels.items() if key in LabelLine.model_fields}
        self.labels_fault: str | None = None
        try:
            labels = LabelLine.model_validate_json(json.dumps({**placed, **own}))
        except ValidationError as error:
            self.labels_fault = first_fault(error)
            labels = LabelLine.model_validate_json(json.dumps(placed))
        super().__init__(dataset, labels)
        self.camera = info.camera or dataset.camera
        self.arrays = dict(reading.arrays)

    def distances_m(
        self, directions: ArrayLike, origin_m: ArrayLike = (0.0, 0.0, 0.0), after_s: ArrayLike = 0.0
    ) -> FloatArray:
        """Distances along rays to the mesh; see :class:`posse_core.StoredReading`."""
        directions = np.asarray(directions, dtype=np.float64)
        after_s = np.broadcast_to(np.asarray(after_s, dtype=np.float64), len(directions))
        distances_m = np.empty(len(directions))
        for instant_s in np.unique(after_s):
            vertices_m = self.in_camera(self.mesh.vertices_body_m, after_s=float(instant_s))
            meeting = RayMeeting((vertices_m - np.asarray(origin_m))[self.mesh.faces])
            for i in np.flatnonzero(after_s == instant_s):
                times = meeting.depth_m(directions[i])
                distances_m[i] = times * float(np.linalg.norm(directions[i]))
        return distances_m


def _mounted(info: SensorInfo, frame: LabelLine, said: ReadingLabels) -> Iterator[str]:
    """The pose at the frame's instant is the frame's, seen from the mount."""
    if not frame.has("q_cam_from_body", "t_body_cam_m"):
        return
    R_sensor_from_camera = info.mount.R_camera_from_sensor.T
    R = R_sensor_from_camera @ frames.matrix_from_quaternion(np.array(frame.q_cam_from_body))
    t_m = R_sensor_from_camera @ (np.array(frame.t_body_cam_m) - info.mount.position_m)
    turn = R.T @ frames.matrix_from_quaternion(np.array(said.q_sensor_from_body))
    if np.linalg.norm(frames.rotation_vector_from_matrix(turn)) > MOUNT_ERROR:
        yield "q_sensor_from_body is not the frame's attitude by the mount"
    off_m = np.linalg.norm(t_m - np.array(said.t_body_sensor_m))
    if off_m > MOUNT_ERROR * np.linalg.norm(frame.t_body_cam_m):
        yield f"t_body_sensor_m is {off_m:.3g} m off the frame's position by the mount"


def _as_a_frame(case: ReadingCase, said: ReadingLabels) -> Iterator[str]:
    """The labels that the scenario's annotators made, by the checks of frames."""
    if case.labels_fault is not None:
        yield case.labels_fault
        return
    for key, own in (
        ("q_cam_from_body", said.q_sensor_from_body),
        ("t_body_cam_m", said.t_body_sensor_m),
    ):
        if key in said.labels and tuple(getattr(case.labels, key)) != tuple(own):
            yield f"{key} is not the reading's pose"
            return
    for check in (SCHEMA, *(check for check in CHECKS if check.name != "files")):
        if check.applies(case):
            for message in check.run(case):
                yield f"{check.name}: {message}"
    for name, array in case.arrays.items():
        fault = case.array_fault(name, array) if name in ARRAYS else None
        if fault is not None:
            yield fault
