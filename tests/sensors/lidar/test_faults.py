"""What is found wrong with readings that were written. The referee's distances are a plane's."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posse_core._interfaces.sensor import StoredReading
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._sensors.lidar.lidar import LidarSensor
from posse_core._sensors.lidar.options import LidarOptions
from posse_core.testing import scenes

HALF_M = 1.0


def distances_m(directions: Any, origin_m: Any, after_s: Any) -> np.ndarray:
    """To a square plate across the axis, 20 m away."""
    directions = np.asarray(directions)
    where = directions * (20 / directions[:, 2:])
    on = (np.abs(where[:, :2]) < HALF_M).all(axis=1)
    return np.where(on, np.linalg.norm(where, axis=1), np.inf)


@pytest.fixture
def reading(sense) -> Reading:
    plate = scenes.rectangle("plate", "matt")
    pattern = {"shape": "raster", "columns": 20, "rows": 20, "width_deg": 8, "height_deg": 8}
    return sense([plate], {"pattern": pattern}, t_m=(0, 0, 20))


def faults(reading: Reading, referee=distances_m) -> list[str]:
    stored = StoredReading(0, SimpleNamespace(), reading, None, Mount(), ("plate",), referee)
    return list(LidarSensor(LidarOptions()).faults(stored))


def with_array(reading: Reading, name: str, array: Any) -> Reading:
    arrays = dict(reading.arrays)
    if array is None:
        del arrays[name]
    else:
        arrays[name] = array
    return replace(reading, arrays=arrays)


def test_a_reading_is_right(reading):
    assert faults(reading) == []
    assert 50 < reading.labels["returns"] < 350


@pytest.mark.parametrize(
    ("name", "alter", "words"),
    [
        ("true_range_m", lambda x: x + 1e-5, "and the mesh is at"),
        ("true_range_m", lambda x: np.full_like(x, 20.0), "and the mesh is at inf m"),
        ("true_range_m", lambda x: x * np.nan, "is inf, and the mesh is at 20"),
        ("direction_sensor", lambda x: x[:, [1, 0, 2]] * [1, 1.01, 1], "is not range_m times"),
        ("range_m", lambda x: x + 0.1, "is not range_m times"),
        ("part_id", lambda x: x + np.int16(1), "part_id does not name a part"),
        ("intensity_e", lambda x: np.nan_to_num(x), "intensity_e is not there"),
        ("saturated", lambda x: ~x, "saturated is 0, and the arrays have 400"),
        ("after_s", lambda x: None, "after_s is NoneType"),
        ("point_sensor_m", lambda x: x[:-1], "point_sensor_m is float64 of shape (399, 3)"),
        ("range_m", lambda x: x.astype(np.float32), "range_m is float32"),
    ],
)
def test_what_was_changed_is_told(reading, name, alter, words):
    assert any(words in line for line in faults(with_array(reading, name, alter(reading.arrays[name]))))


def test_a_wrong_count_is_told(reading):
    wrong = replace(reading, labels={**reading.labels, "returns": 3})
    assert faults(wrong) == [f"returns is 3, and the arrays have {reading.labels['returns']}"]


def test_an_axis_on_an_edge_may_be_on_either_side(reading):
    """The referee's plate ends before beams that meet it: by a micrometre, no fault; by 0.1 mm, one."""
    direction = reading.arrays["direction_sensor"]
    x = np.abs(direction[:, :2] / direction[:, 2:] * 20).max(axis=1)
    outermost = x[reading.arrays["part_id"] >= 0].max()

    def smaller(by_m):
        def referee(directions, origin_m, after_s):
            shrunk = np.asarray(directions) / [outermost - by_m, outermost - by_m, 1]
            found = distances_m(shrunk, origin_m, after_s)
            exact_m = 20 / np.asarray(directions)[:, 2] * np.linalg.norm(directions, axis=1)
            return np.where(np.isfinite(found), exact_m, np.inf)

        return referee

    assert faults(reading, smaller(1e-6)) == []
    assert faults(reading, smaller(1e-4))
