"""Files of points, read back by trimesh, laspy and pypcd4."""

from __future__ import annotations

import io
import sys

import laspy
import numpy as np
import pytest
import trimesh
from pypcd4 import PointCloud

from posse_core._errors import ComponentError
from posse_core._sensors.lidar.clouds import FORMATS, Points


def points(count: int, scale_m: float = 30.0) -> Points:
    rng = np.random.default_rng(count)
    return Points(
        point_sensor_m=rng.normal(0, scale_m, (count, 3)),
        intensity_e=rng.uniform(0, 1e6, count),
        part_id=rng.integers(0, 40, count),
        beam=np.sort(rng.choice(10 * count + 1, count, replace=False)),
        after_s=np.sort(rng.uniform(0, 1, count)),
    )


def assert_columns(found, expected: Points) -> None:
    np.testing.assert_array_equal(found("part_id"), expected.part_id)
    np.testing.assert_array_equal(found("beam"), expected.beam)
    np.testing.assert_array_equal(found("after_s"), expected.after_s)


@pytest.mark.parametrize("count", [0, 1, 500])
def test_ply(count):
    made = points(count)
    raw = trimesh.exchange.ply.load_ply(io.BytesIO(FORMATS["ply"](made)))["metadata"]["_ply_raw"][
        "vertex"
    ]
    assert raw["length"] == count
    if count:
        data = raw["data"]
        np.testing.assert_array_equal(np.stack([data[a].ravel() for a in "xyz"], 1), made.point_sensor_m)
        assert_columns(lambda name: data[name].ravel(), made)
        np.testing.assert_allclose(data["intensity"].ravel(), made.intensity_e, rtol=1e-7)


@pytest.mark.parametrize(
    ("count", "scale_m", "step_m"), [(0, 30, 1e-6), (500, 30, 1e-6), (500, 3e4, 1e-4)]
)
def test_las(count, scale_m, step_m):
    made = points(count, scale_m)
    las = laspy.read(io.BytesIO(FORMATS["las"](made)))
    assert len(las.points) == count
    np.testing.assert_allclose(las.xyz, made.point_sensor_m, rtol=0, atol=step_m)
    columns = {"part_id": las.part_id, "beam": las.beam, "after_s": las.gps_time}
    assert_columns(lambda name: np.asarray(columns[name]), made)
    np.testing.assert_allclose(las.intensity_e, made.intensity_e, rtol=1e-7)


@pytest.mark.parametrize("count", [0, 500])
def test_pcd(count):
    made = points(count)
    cloud = PointCloud.from_fileobj(io.BytesIO(FORMATS["pcd"](made)))
    assert cloud.points == count
    if count:
        np.testing.assert_array_equal(cloud.numpy(("x", "y", "z")), made.point_sensor_m)
        assert_columns(lambda name: cloud.pc_data[name], made)
        np.testing.assert_allclose(cloud.pc_data["intensity"], made.intensity_e, rtol=1e-7)


@pytest.mark.parametrize("name", FORMATS)
def test_files_are_the_same_whenever_they_are_made(name):
    assert FORMATS[name](points(50)) == FORMATS[name](points(50))


@pytest.mark.parametrize(("name", "library"), [("las", "laspy"), ("pcd", "pypcd4")])
def test_a_missing_library_is_named_with_the_way_out(name, library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ComponentError, match=rf"{library} cannot be .*pip install posse-core\[lidar\]"):
        FORMATS[name](points(2))
