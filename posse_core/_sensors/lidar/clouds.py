"""Files of points: PLY, LAS and PCD."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from importlib import import_module
from typing import Any, Final

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import ComponentError
from posse_core._sensors.lidar.options import Format

_COLUMNS = [
    ("x", "<f8"),
    ("y", "<f8"),
    ("z", "<f8"),
    ("intensity", "<f4"),
    ("part_id", "<i2"),
    ("beam", "<i4"),
    ("after_s", "<f8"),
]
_PLY_TYPES = {"<f8": "double", "<f4": "float", "<i2": "short", "<i4": "int"}
_LEAST_LAS_STEP_M = 1e-6
_MOST_STEPS = 2**31 - 2
_LAS_DATE = date(2000, 1, 1)
"""The same in every file, so that a reading is made again with the same bits."""


@dataclass(frozen=True)
class Points:
    """The points of one reading, in sensor axes.

    Attributes:
        point_sensor_m: (P, 3).
        intensity_e: (P,) measured signal, electrons.
        part_id: (P,) index of the part.
        beam: (P,) index of the beam.
        after_s: (P,) seconds after the reading's instant.
    """

    point_sensor_m: FloatArray
    intensity_e: FloatArray
    part_id: IntArray
    beam: IntArray
    after_s: FloatArray

    def table(self) -> np.ndarray[Any, np.dtype[np.void]]:
        """(P,) rows as they stand in a file."""
        rows = np.empty(len(self.beam), _COLUMNS)
        rows["x"], rows["y"], rows["z"] = self.point_sensor_m.T
        rows["intensity"], rows["part_id"] = self.intensity_e, self.part_id
        rows["beam"], rows["after_s"] = self.beam, self.after_s
        return rows


def _ply(points: Points) -> bytes:
    """Binary PLY with float64 positions."""
    rows = points.table()
    properties = [f"property {_PLY_TYPES[kind]} {name}" for name, kind in _COLUMNS]
    header = [
        *(
            "ply",
            "format binary_little_endian 1.0",
            "comment sensor axes, metres; intensity in electrons",
        ),
        *(f"element vertex {len(rows)}", *properties, "end_header\n"),
    ]
    return "\n".join(header).encode() + rows.tobytes()


def _las(points: Points) -> bytes:
    """LAS 1.4, whose positions are integers: multiples of 1 µm, or of a power of ten more where the
    points are too far for that."""
    laspy = _library(_NEEDED["las"])
    rows = points.table()
    farthest_m = float(np.abs(points.point_sensor_m).max(initial=0.0))
    step_m = _LEAST_LAS_STEP_M
    while farthest_m / step_m > _MOST_STEPS:
        step_m *= 10
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.creation_date = _LAS_DATE
    header.scales = np.full(3, step_m)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("intensity_e", np.float32),
            laspy.ExtraBytesParams("part_id", np.int16),
            laspy.ExtraBytesParams("beam", np.int32),
        ]
    )
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.point_sensor_m.T
    las.gps_time = rows["after_s"]
    las.intensity_e, las.part_id, las.beam = rows["intensity"], rows["part_id"], rows["beam"]
    stream = io.BytesIO()
    las.write(stream)
    return stream.getvalue()


def _pcd(points: Points) -> bytes:
    """Binary PCD with float64 positions."""
    pypcd4 = _library(_NEEDED["pcd"])
    rows = points.table()
    cloud = pypcd4.PointCloud.from_points(
        [rows[name] for name, _ in _COLUMNS],
        [name for name, _ in _COLUMNS],
        [np.dtype(kind).type for _, kind in _COLUMNS],
    )
    stream = io.BytesIO()
    cloud.save(stream)
    return stream.getvalue()


FORMATS: Final[dict[Format, Callable[[Points], bytes]]] = {"ply": _ply, "las": _las, "pcd": _pcd}
"""The content of a file by its format."""


_NEEDED: Final[Mapping[Format, str]] = {"las": "laspy", "pcd": "pypcd4"}
"""Format → the module that writes it, if the core needs one; the extra ``lidar`` installs all."""


def check(formats: Iterable[Format]) -> None:
    """Raise a ComponentError if the library that writes one of the formats is missing."""
    for chosen in formats:
        if chosen in _NEEDED:
            _library(_NEEDED[chosen])


def _library(name: str) -> Any:
    """An optional dependency.

    Raises:
        ComponentError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise ComponentError(
            f"{name} cannot be imported ({error}), which writes this format of points; install it with"
            " 'pip install posse-core[lidar]', or leave the format out of the sensor's formats"
        ) from None
