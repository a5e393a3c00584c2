"""A dataset with a scanner and a flash, run, proven by other code, and read back."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.validate import validate

SENSORS = """\
sensors:
  scanner:
    type: lidar
    mount: {position_m: [0.5, 0.1, 0], rotation_vector_deg: [0, 1, 10]}
    rate_hz: 0.002
    pattern: {shape: given, path: beams.csv}
    noise: {range_m: 0.02}
  flash: {type: lidar, formats: [las],
          pattern: {shape: flash, width_px: 24, height_px: 18, hfov_deg: 50}}
"""


@pytest.fixture(scope="module")
def dataset(posse_in, small_scenario) -> Dataset:
    folder: Path = small_scenario.parent
    rng = np.random.default_rng(1)
    beams = np.column_stack([np.linspace(0, 0.4, 300), rng.uniform(-0.3, 0.3, (300, 2)), np.ones(300)])
    np.savetxt(
        folder / "beams.csv", beams, delimiter=",", header="t_s,r_beam_x,r_beam_y,r_beam_z", comments=""
    )
    path = folder / "lidar.yaml"
    path.write_text(small_scenario.read_text().replace("count: 8", "count: 3") + SENSORS)
    done = posse_in(folder, "run", path, "--out", "lidar")
    assert done.returncode == 0, done.stderr
    return Dataset(folder / "lidar")


def test_it_proves_itself(dataset):
    report = validate(dataset, lambda places, frames: places)
    assert report.passed, [f for r in report.results for f in r.faults][:3]
    checked = {result.name: result.checked for result in report.results}
    assert checked["sensor scanner"] == checked["sensor flash"] == 3


def test_points_lie_on_the_mesh(dataset):
    """True ranges, moved into body axes by the labels' pose and rates, against trimesh's nearest
    points; the rates are small enough for their first order."""
    mesh = trimesh.load(dataset.folder / "spacecraft" / f"{dataset[0].spacecraft}.ply", process=False)
    seen = 0
    for i, labels in enumerate(dataset):
        for said, reading in zip(labels.sensors["scanner"], dataset.readings(i, "scanner"), strict=True):
            arrays = reading.arrays
            hit = np.isfinite(arrays["true_range_m"])
            w, x, y, z = said.q_sensor_from_body
            R = trimesh.transformations.quaternion_matrix([w, x, y, z])[:3, :3]
            point = arrays["true_range_m"][hit, None] * arrays["direction_sensor"][hit]
            after = arrays["after_s"][hit, None]
            then = point + after * np.cross(said.omega_sensor_rad_s, point)
            then = then - said.t_body_sensor_m - after * np.array(said.v_body_sensor_m_s)
            body = then @ R
            body = body - after * np.cross(said.omega_body_rad_s, body)
            _, off_m, _ = trimesh.proximity.closest_point(mesh, body)
            assert off_m.max(initial=0) < 1e-4
            seen += hit.sum()
    assert seen > 100


def test_files_hold_the_points_that_returned(dataset):
    (said, *_), (reading, *_) = dataset[0].sensors["scanner"], dataset.readings(0, "scanner")
    assert [Path(name).suffix for name in said.files] == [".npz", ".ply"]
    cloud = trimesh.load(io.BytesIO((dataset.folder / said.files[1]).read_bytes()), file_type="ply")
    point_m = reading.arrays["point_sensor_m"]
    np.testing.assert_allclose(cloud.vertices, point_m[np.isfinite(point_m[:, 0])], rtol=0, atol=1e-12)
    assert len(cloud.vertices) == said.labels["returns"] > 50
    assert dataset.sensors["flash"].camera.width_px == 24
    (flashed,) = dataset[0].sensors["flash"]
    assert [Path(name).suffix for name in flashed.files] == [".las", ".npz"]


def test_a_missing_table_is_named(posse, small_scenario, dataset):
    path = small_scenario.parent / "lidar.yaml"
    done = posse("run", path, "--out", "d", "-o", "sensors.scanner.pattern.path=absent.csv")
    assert done.returncode == 2
    assert "sensors.scanner" in done.stderr
    assert "absent.csv: cannot be read: there is no such file" in done.stderr
    assert "Traceback" not in done.stderr
