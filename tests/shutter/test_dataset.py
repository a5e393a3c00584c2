"""A dataset of a spinning spacecraft with rolling shutter and blur: it passes validation, and fails if
its camera.json claims a global shutter."""

import json
import shutil

import pytest
from small_run import make_small

OPTIONS = (
    "target={name: cubesat}",
    "renderer.seconds=0",
    "attitude.target={law: spin, body_axis: +z, rate_rpm: 60}",
    "camera.line_time_s=0.002",
    "camera.hfov_deg=5",
    "camera.distortion=[-40.0, 0, 0.1, -0.1, 0]",
    "sensor.motion_blur={instants: 2}",
    "sensor.auto_exposure={level: 0.5}",
    "annotators=[box, mask, parts, depth, normals, keypoints, pose]",
    "times={t_s: [0, 40]}",
)


@pytest.fixture(scope="module")
def rolling(posse_in, tmp_path_factory):
    return make_small(posse_in, tmp_path_factory.mktemp("rolling"), OPTIONS)


def test_it_is_validated_row_by_row(posse, rolling):
    proof = posse("validate", rolling)
    assert proof.returncode == 0, proof.stdout
    assert json.loads((rolling / "camera.json").read_text())["lineTime_s"] == 0.002
    lines = [json.loads(x) for x in (rolling / "labels/shard-00000.jsonl").read_text().splitlines()]
    assert all(abs(line["omega_body_rad_s"][2] - 6.283185) < 1e-5 for line in lines)
    assert lines[0]["exposure_s"] > 0


def test_validation_fails_with_a_global_shutter(posse, rolling, tmp_path):
    shutil.copytree(rolling, tmp_path / "d")
    camera = json.loads((tmp_path / "d/camera.json").read_text())
    (tmp_path / "d/camera.json").write_text(json.dumps({**camera, "lineTime_s": 0.0}))
    proof = posse("validate", "d", "--json")
    assert proof.returncode == 1
    failed = {c["name"] for c in json.loads(proof.stdout)["checks"] if c["faults"]}
    assert {"keypoints", "whole-box", "mask", "depth"} <= failed
