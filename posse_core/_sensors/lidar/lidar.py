"""A lidar: pulses of light, and the distances of what reflects them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, array_fault, evenly_spread
from posse_core._frames import R_with_z
from posse_core._geometry.surface import Surface
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.reading import Reading
from posse_core._sensors.lidar.beams import flash_camera, flashed, scanned
from posse_core._sensors.lidar.clouds import FORMATS, Points, check
from posse_core._sensors.lidar.options import FlashOptions, LidarOptions
from posse_core._sensors.lidar.receiver import Receiver
from posse_core._sensors.lidar.returning import Returning, returning

_BLOCK = 1 << 17
"""Rays whose arrays are held at once."""
_TOLERANCE_M = 1e-6
"""By how much a true range that was written may differ from the mesh."""
_CHECKED = 40
"""Beams of a reading that ``posse validate`` casts again, of those that meet the spacecraft; and as many
others."""
_EDGE_M, _BESIDE_M = 3e-6, 3e-4
"""How near an edge an axis may pass for its true range to be either side's, and how far that range may
be from that of an axis so far beside."""

_ARRAYS = {
    "direction_sensor": ((3,), "float64"),
    "after_s": ((), "float64"),
    "point_sensor_m": ((3,), "float64"),
    "range_m": ((), "float64"),
    "true_range_m": ((), "float64"),
    "intensity_e": ((), "float64"),
    "saturated": ((), "bool_"),
    "part_id": ((), "int16"),
}
"""Arrays of a reading: what follows the number of beams in their shape, and their type."""


class LidarSensor(Sensor[LidarOptions]):
    """Scans the scene with a pulsed beam, or lights it with one flash.

    Each beam is aimed at an instant of its own. The rays that stand for its cross-section meet the
    spacecraft where it is then; what they reflect, by the material there, gives the signal by the lidar
    equation, and the signal its random errors.
    """

    def open(self, setting: SensorSetting) -> None:
        """See :meth:`Sensor.open`.

        Raises:
            InputError: the table of a given pattern cannot be used.
            ComponentError: a library that writes the points is not installed.
        """
        check(self.options.formats)
        pattern = self.options.pattern
        if isinstance(pattern, FlashOptions):
            self.camera = flash_camera(pattern)
            self._beams = flashed(pattern, self.camera)
        else:
            self._beams = scanned(pattern)
        self._receiver = Receiver(self.options)
        self._surface = Surface(setting.scene.pieces)

    def sense(self, look: SensorLook) -> Reading:
        """One scan or flash; the instants of its beams follow that of the look."""
        beams = self._beams
        light = Returning.joined(
            returning(look, block, self._surface, self._receiver, self.options)
            for block in beams.blocks(_BLOCK)
        )
        measured = self._receiver.measured(
            light.signal_e,
            light.background_e,
            light.range_m,
            light.spread_m,
            look.generator("errors"),
        )
        detected = measured.detected
        intensity_e = np.where(detected, measured.signal_e, np.nan)
        part_id = np.where(detected, light.part_id, -1).astype(np.int16)
        point_sensor_m = measured.range_m[:, None] * beams.axis
        rows = np.flatnonzero(detected)
        points = Points(
            point_sensor_m[rows], intensity_e[rows], part_id[rows], rows, beams.after_s[rows]
        )
        return Reading(
            labels={
                "beams": len(beams.axis),
                "returns": len(rows),
                "drop_outs": int(np.count_nonzero((light.signal_e > 0) & ~detected)),
                "saturated": int(np.count_nonzero(measured.saturated)),
            },
            arrays={
                "direction_sensor": beams.axis,
                "after_s": beams.after_s,
                "point_sensor_m": point_sensor_m,
                "range_m": measured.range_m,
                "true_range_m": light.axis_range_m,
                "intensity_e": intensity_e,
                "saturated": measured.saturated,
                "part_id": part_id,
            },
            files={f".{name}": FORMATS[name](points) for name in self.options.formats},
        )

    def faults(self, stored: StoredReading) -> Iterator[str]:
        """Casts the axes of some beams again, and compares the arrays with each other and the labels."""
        arrays, labels = stored.reading.arrays, stored.reading.labels
        count = len(arrays["range_m"]) if "range_m" in arrays else 0
        for name, (columns, kind) in _ARRAYS.items():
            fault = array_fault(arrays.get(name), (count, *columns), kind, finite=False)
            if fault is not None:
                yield f"{name} {fault}"
                return
        direction, range_m = arrays["direction_sensor"], arrays["range_m"]
        yield from _off_the_mesh(stored, direction, arrays["after_s"], arrays["true_range_m"])
        if not np.array_equal(arrays["point_sensor_m"], range_m[:, None] * direction, equal_nan=True):
            yield "point_sensor_m is not range_m times direction_sensor"
        returned = np.isfinite(range_m)
        part_id = arrays["part_id"]
        if (returned != (part_id >= 0)).any() or (part_id >= len(stored.parts)).any():
            yield "part_id does not name a part where a beam returned, and none where it did not"
        if (returned != np.isfinite(arrays["intensity_e"])).any():
            yield "intensity_e is not there where a beam returned, and only there"
        counts = {
            "beams": count,
            "returns": int(np.count_nonzero(returned)),
            "saturated": int(np.count_nonzero(arrays["saturated"])),
        }
        for key, found in counts.items():
            if labels.get(key) != found:
                yield f"{key} is {labels.get(key)}, and the arrays have {found}"


def _off_the_mesh(
    stored: StoredReading, direction: FloatArray, after_s: FloatArray, true_m: FloatArray
) -> Iterator[str]:
    """Whether some beams' axes meet the mesh where the reading says: of those that meet it and of those
    that do not."""
    meets = np.isfinite(true_m)
    some = np.concatenate(
        [rows[evenly_spread(len(rows), _CHECKED)] for rows in map(np.flatnonzero, (meets, ~meets))]
    )
    written_m = np.where(meets, true_m, np.inf)[some]
    axis, at_s = direction[some], after_s[some]
    again_m = stored.distances_m(axis, np.zeros(3), at_s)
    off = ~_agree(written_m, again_m, _TOLERANCE_M)
    # An axis that passes an edge within a few micrometres may end on either side of it.
    rows = np.flatnonzero(~_agree(written_m, again_m, _BESIDE_M))
    x, y, _ = np.moveaxis(R_with_z(axis[rows]), -1, 0)
    tilt = _EDGE_M / np.minimum(written_m, again_m)[rows, None]
    for side in (x, -x, y, -y):
        beside_m = stored.distances_m(axis[rows] + tilt * side, np.zeros(3), at_s[rows])
        off[rows] &= ~_agree(written_m[rows], beside_m, _BESIDE_M)
    for i in np.flatnonzero(off):
        yield (
            f"true_range_m of beam {some[i]} is {written_m[i]:.6f}, and the mesh is at"
            f" {again_m[i]:.6f} m"
        )


def _agree(one_m: FloatArray, other_m: FloatArray, tolerance_m: float) -> BoolArray:
    """(N,) whether two distances are equal, both infinite included."""
    return np.isclose(one_m, other_m, rtol=0, atol=tolerance_m)
