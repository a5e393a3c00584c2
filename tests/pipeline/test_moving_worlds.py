"""A run with joints, several bodies and sensors: proven, resumed, joined and divided."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from posse_core._dataset.dataset import Dataset

SCENARIO = """\
target: {name: arm}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000, e: 0.001, i_deg: 98, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {roe_m: [0, 0, -2.4, -1.8, -2.4, -1.8]}
times: {duration_s: 6, count: 2}
attitude: {target: {law: spin, rate_rpm: 2, sun_angle_deg: 60}, camera: track}
joints: {shoulder: {law: rate, rate_deg_s: 3}, elbow: {law: fixed, value_deg: 40}}
bodies:
  inspector:
    spacecraft: {name: cubesat}
    relative: {roe_m: [0, 0, -1.9, -1.5, -1.9, -1.5]}
    attitude: {law: spin, rate_rpm: 3, sun_angle_deg: 10}
  arm:
    spacecraft: {name: arm}
    mount: {position_m: [0.75, 0.55, 0.6], rotation_vector_deg: [0, -28, 0]}
    joints: {wrist: {law: rate, rate_deg_s: 5}, finger_left: {law: random, range_m: [0, 0.05]}}
camera: {width_px: 80, height_px: 60, hfov_deg: 60, line_time_s: 0.001}
sky: {earth: false, stars: null}
annotators: [box, mask, parts, depth, normals, keypoints, pose, optical-flow, scene-flow]
sensors:
  right: {type: stereo, baseline_m: 0.4}
  side:
    type: camera
    mount: {position_m: [0.2, 0, 0], rotation_vector_deg: [0, 5, 20]}
    rate_hz: 0.25
  scanner: {type: lidar, pattern: {shape: raster, columns: 20, rows: 16, width_deg: 60, height_deg: 45}}
renderer: {name: flat}
writers: []
seed: 5
"""


@pytest.fixture(scope="module")
def made(posse_in, tmp_path_factory) -> Path:
    """The dataset; not to be changed but by what changes nothing."""
    folder = tmp_path_factory.mktemp("moving")
    (folder / "moving.yaml").write_text(SCENARIO)
    done = posse_in(folder, "run", "moving.yaml", "--out", "d")
    assert done.returncode == 0, done.stderr
    return folder / "d"


def test_the_dataset_is_proven(made, posse_in):
    done = posse_in(made.parent, "validate", "d", "--json")
    assert done.returncode == 0, done.stdout
    checks = {check["name"]: check["checked"] for check in json.loads(done.stdout)["checks"]}
    unproven = {"albedo", "partition"}
    assert {name for name, checked in checks.items() if checked == 0} == unproven


def test_its_bodies_and_joints_are_described(made):
    dataset = Dataset(made)
    assert {name: info.name for name, info in dataset.bodies.items()} == {
        "arm": "arm",
        "inspector": "cubesat",
    }
    assert [joint.name for joint in dataset.spacecraft.joints] == ["shoulder", "elbow"]
    assert [joint.name for joint in dataset.bodies["arm"].joints] == ["wrist", "finger_left"]
    assert dataset.bodies["inspector"].joints == ()
    line = dataset[0]
    assert list(line.bodies) == ["inspector", "arm"]
    assert line.bodies["arm"].is_carried
    assert not line.bodies["inspector"].has("is_carried", "joints")
    values_rad = [reading.joints["shoulder"].value for reading in line.sensors["side"]]
    np.testing.assert_allclose(np.diff(values_rad) / 4, np.radians(3))  # rate_hz is 0.25
    parts = [len(info.parts) for info in (dataset.spacecraft, *map(dataset.bodies.get, line.bodies))]
    truth = dataset.truth(0)
    firsts = np.cumsum([0, *parts])
    for number in range(3):
        of_body = truth["part_id"][truth["body_id"] == number]
        assert of_body.min() >= firsts[number]
        assert of_body.max() < firsts[number + 1]


def test_it_can_be_resumed_joined_and_divided(made, posse_in: Callable):
    before = (made / "manifest.json").read_bytes()
    done = posse_in(made.parent, "run", "moving.yaml", "--out", "d", "--resume")
    assert done.returncode == 0, done.stderr
    assert (made / "manifest.json").read_bytes() == before
    assert {name for name in json.loads(before)["sha256"] if name.startswith("bodies/")} == {
        f"bodies/{body}.{ending}"
        for body in ("arm/arm", "inspector/cubesat")
        for ending in ("json", "ply")
    }
    for words in (("collect", "d", "d", "--out", "both"), ("partition", "both")):
        done = posse_in(made.parent, *words)
        assert done.returncode == 0, done.stdout + done.stderr
    assert len(Dataset(made.parent / "both")) == 4
    assert Dataset(made.parent / "both").bodies.keys() == {"arm", "inspector"}
