"""Checks of the readings of sensors beside the camera."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
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
from posse_core._evaluation.case import ARRAYS, POSE, Case
from posse_core._evaluation.checks import CHECKS, SCHEMA
from posse_core._evaluation.placed import JointsSaid
from posse_core._evaluation.result import Fault, Result
from posse_core._interfaces.sensor import Sensor, StoredReading
from posse_core._model.label_line import BodyReading, LabelLine, ReadingLabels, Vector, first_fault
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
        of_all: dict[str, ReadingLabels | BodyReading] = {"": said, **said.bodies}
        for name, each in of_all.items():
            q = np.array(each.q_sensor_from_body)
            if not abs(np.linalg.norm(q) - 1) <= MOUNT_ERROR or q[0] < 0:
                which = f"{name}: " if name else ""
                fault = "is not a unit quaternion with a scalar part of at least 0"
                yield f"{which}q_sensor_from_body {fault}"
                return
        if said.bodies.keys() != (labels.bodies.keys() if labels.has("bodies") else set()):
            yield "its bodies are not those of the frame"
            return
        case = ReadingCase(self._dataset, info, labels, said, reading)
        if case.labels_fault is not None:
            yield case.labels_fault
            return
        for body in case.bodies:
            if body.joints.keys() != {joint.name for joint in body.craft.joints}:
                yield f"its joints are not those of {body.where}.json"
                return
        if number == 0:
            yield from _mounted(info, Case(self._dataset, labels), case)
        if info.camera is not None and any(name in said.labels for name in _OF_A_CAMERA):
            yield from _as_a_frame(case)
        component = self._components.get(info.name)
        if component is not None:
            stored = StoredReading(
                index=labels.index,
                labels=said,
                reading=reading,
                camera=info.camera,
                mount=info.mount,
                parts=case.parts,
                distances_m=case.distances_m,
            )
            with failures_named("sensor", info.type):
                yield from component.faults(stored)


class ReadingCase(Case):
    """A reading under test in the place of a frame, the sensor in that of the dataset's camera.

    Attributes:
        said: the reading's labels.
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
        own = {key: value for key, value in said.labels.items() if key in LabelLine.model_fields}
        placed = {
            **{key: getattr(frame, key) for key in _OF_THE_FRAME},
            **_pose_said(said, said.omega_sensor_rad_s),
        }
        beside = {
            name: {
                "spacecraft": frame.bodies[name].spacecraft,
                **_pose_said(body, said.omega_sensor_rad_s),
            }
            for name, body in said.bodies.items()
        }
        self.said = said
        self.labels_fault: str | None = None
        try:
            labels = LabelLine.model_validate_json(
                json.dumps({**own, **placed, **_bodies(beside, own.get("bodies", {}))})
            )
        except (TypeError, ValidationError) as error:
            self.labels_fault = (
                first_fault(error) if isinstance(error, ValidationError) else f"bodies: {error}"
            )
            labels = LabelLine.model_validate_json(json.dumps({**placed, **_bodies(beside, {})}))
        super().__init__(dataset, labels)
        self.camera = info.camera or dataset.camera
        self.arrays = dict(reading.arrays)

    def joints(self, body: str = "") -> JointsSaid:
        """Joints of the target, or of a body beside it, as the reading has them."""
        return self.said.bodies[body].joints if body else self.said.joints

    def distances_m(
        self, directions: ArrayLike, origin_m: ArrayLike = (0.0, 0.0, 0.0), after_s: ArrayLike = 0.0
    ) -> FloatArray:
        """Distances along rays to the mesh; see :class:`posse_core.StoredReading`."""
        directions = np.asarray(directions, dtype=np.float64)
        after_s = np.broadcast_to(np.asarray(after_s, dtype=np.float64), len(directions))
        lengths = self.met_after(directions, after_s, origin_m)
        return np.asarray(lengths * np.linalg.norm(directions, axis=1))


def _pose_said(said: ReadingLabels | BodyReading, omega_sensor_rad_s: Vector) -> dict[str, Any]:
    """Pose and rates in the keys of a label line, the sensor's axes in place of the camera's."""
    return {
        "q_cam_from_body": said.q_sensor_from_body,
        "t_body_cam_m": said.t_body_sensor_m,
        "v_body_cam_m_s": said.v_body_sensor_m_s,
        "omega_body_rad_s": said.omega_body_rad_s,
        "omega_camera_rad_s": omega_sensor_rad_s,
        **({"is_carried": True} if isinstance(said, BodyReading) and said.is_carried else {}),
    }


def _bodies(placed: Mapping[str, dict[str, Any]], own: Any) -> dict[str, Any]:
    """The key ``bodies`` of a line: what the sensor itself labels of them, and where they are.

    Raises:
        TypeError: what the sensor labels is not of bodies.
    """
    if not placed:
        return {}
    if not isinstance(own, dict) or not all(isinstance(each, dict) for each in own.values()):
        raise TypeError("is not an object of objects")
    return {"bodies": {name: {**own.get(name, {}), **body} for name, body in placed.items()}}


def _mounted(info: SensorInfo, frame: Case, case: ReadingCase) -> Iterator[str]:
    """The poses at the frame's instant are the frame's, seen from the mount."""
    if not frame.has(*POSE):
        return
    R_sensor_from_camera = info.mount.R_camera_from_sensor.T
    for body, there in zip(frame.bodies, case.bodies, strict=True):
        which = f"{body.name}: " if body.number else ""
        turn = there.R_cam_from_body.T @ R_sensor_from_camera @ body.R_cam_from_body
        if np.linalg.norm(frames.rotation_vector_from_matrix(turn)) > MOUNT_ERROR:
            yield f"{which}q_sensor_from_body is not the frame's attitude by the mount"
        t_m = np.array(body.labels.t_body_cam_m)
        off_m = np.linalg.norm(
            R_sensor_from_camera @ (t_m - info.mount.position_m) - there.placed.t_body_cam_m
        )
        if off_m > MOUNT_ERROR * max(1.0, float(np.linalg.norm(t_m))):
            yield f"{which}t_body_sensor_m is {off_m:.3g} m off the frame's position by the mount"
        for name, joint in body.joints.items():
            if (joint.value, joint.rate) != (there.joints[name].value, there.joints[name].rate):
                yield f"{which}joint {name}: value and rate are not the frame's"


def _as_a_frame(case: ReadingCase) -> Iterator[str]:
    """The labels that the scenario's annotators made, by the checks of frames."""
    own_bodies: Any = case.said.labels.get("bodies", {})
    for body in case.bodies:
        own: Any = own_bodies.get(body.name, {}) if body.number else case.said.labels
        which = f"{body.name}: " if body.number else ""
        for key in POSE:
            if key in own and own[key] != list(getattr(body.labels, key)):
                yield f"{which}{key} is not the reading's pose"
                return
        for name, joint in (body.labels.joints if body.labels.has("joints") else {}).items():
            said = body.joints.get(name)
            if said is None or (said.value, said.rate) != (joint.value, joint.rate):
                yield f"{which}joint {name}: is not the reading's"
                return
    schema = list(SCHEMA.run(case))
    yield from (f"{SCHEMA.name}: {message}" for message in schema)
    if schema:
        return
    for check in CHECKS:
        if check.name != "files" and check.applies(case):
            for message in check.run(case):
                yield f"{check.name}: {message}"
    for name, array in case.arrays.items():
        fault = case.array_fault(name, array) if name in ARRAYS else None
        if fault is not None:
            yield fault
