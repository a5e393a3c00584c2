"""Reading and writing ``sensors/NAME.json``, which describes a sensor beside the chaser's camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, JsonValue, Strict
from pydantic_core import to_jsonable_python

from posse_core._dataset.camera import CameraFile, camera_record
from posse_core._files.atomic import write_json
from posse_core._files.reading import FileRecord, read_record
from posse_core._frames import matrix_from_quaternion, quaternion_from_matrix
from posse_core._model.camera import Camera
from posse_core._model.mount import Mount


@dataclass(frozen=True)
class SensorInfo:
    """A sensor of a dataset.

    Attributes:
        name: in the scenario.
        type: name of the component.
        mount: where it is, relative to the dataset's camera.
        rate_hz: readings per second; None for one at each frame.
        camera: whose pixels its readings are in; None for a sensor that has none.
        options: of the component; in a dataset, paths of files are relative to its folder.
    """

    name: str
    type: str
    mount: Mount
    rate_hz: float | None
    camera: Camera | None
    options: Mapping[str, Any] = field(default_factory=dict)


def write_sensor(sensor: SensorInfo, path: Path) -> None:
    """Write the description of a sensor; ``camera`` has the keys of ``camera.json``."""
    value = {
        "type": sensor.type,
        "position_m": np.asarray(sensor.mount.position_m, dtype=np.float64).tolist(),
        "q_camera_from_sensor": quaternion_from_matrix(sensor.mount.R_camera_from_sensor).tolist(),
        "rate_hz": sensor.rate_hz,
        "camera": None if sensor.camera is None else camera_record(sensor.camera),
        "options": to_jsonable_python(dict(sensor.options)),
    }
    write_json(path, value)


def read_sensor(path: Path) -> SensorInfo:
    """Read the file of :func:`write_sensor`.

    Raises:
        InputError: The file is missing or of another kind.
    """
    record = read_record(path, _SensorFile, "the description of a sensor")
    mount = Mount(
        np.array(record.position_m), matrix_from_quaternion(np.array(record.q_camera_from_sensor))
    )
    camera = None if record.camera is None else record.camera.camera()
    return SensorInfo(path.stem, record.type, mount, record.rate_hz, camera, record.options)


class _SensorFile(FileRecord):
    """The keys of ``sensors/NAME.json``."""

    type: str
    position_m: Annotated[tuple[float, float, float], Strict(False)]
    q_camera_from_sensor: Annotated[tuple[float, float, float, float], Strict(False)]
    rate_hz: Annotated[float, Field(gt=0)] | None
    camera: CameraFile | None
    options: dict[str, JsonValue]
