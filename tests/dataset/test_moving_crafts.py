"""Files and label lines of spacecraft with joints and of bodies beside the target."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cuboid
import numpy as np
import pytest

import posse_core as posse
from posse_core._dataset.spacecraft import read_bodies, read_spacecraft, write_spacecraft
from posse_core._model.scene import Body, Scene
from posse_core._plugins.loading import load_plugins
from posse_core._run.recording import recording
from posse_core._scenario.load import load_scenario
from posse_core._selection.collect import collect

JOINTS = (
    posse.Joint("boom", "prismatic", np.zeros(3), np.array([1.0, 0.0, 0.0]), limits=(-0.5, np.inf)),
    posse.Joint(
        "wing",
        "revolute",
        np.array([0.5, 0.1, 0.0]),
        np.array([0.0, 0.6, 0.8]),
        parent="boom",
        facing_body=np.array([0.0, 0.0, 1.0]),
    ),
)


def winged() -> posse.Spacecraft:
    """The cuboid with a side and a keypoint on the wing, and another side on the boom."""
    craft = cuboid.cuboid()
    carriers = {"x+": "wing", "x-": "boom"}
    return replace(
        craft,
        parts=tuple(replace(part, joint=carriers.get(part.name)) for part in craft.parts),
        joints=JOINTS,
        keypoint_joints={"T2": "wing"},
    )


def test_joints_are_read_as_they_were_written(tmp_path):
    write_spacecraft(winged(), tmp_path)
    info = read_spacecraft(tmp_path / "brick.json")
    assert [joint.name for joint in info.joints] == ["boom", "wing"]
    for read, written in zip(info.joints, JOINTS, strict=True):
        assert (read.kind, read.parent, read.limits) == (written.kind, written.parent, written.limits)
        np.testing.assert_array_equal(read.origin_body_m, written.origin_body_m)
        np.testing.assert_array_equal(read.axis_body, written.axis_body)
    assert info.joints[0].facing_body is None
    np.testing.assert_array_equal(info.joints[1].facing_body, [0, 0, 1])
    assert info.part_joints == {"x-": "boom", "x+": "wing"}
    assert info.keypoint_joints == {"T2": "wing"}


def test_the_file_of_a_rigid_spacecraft_has_the_keys_that_it_always_had(tmp_path):
    write_spacecraft(cuboid.cuboid(), tmp_path)
    record = json.loads((tmp_path / "brick.json").read_text())
    assert list(record) == ["name", "parts", "keypoints", "skeleton", "symmetries"]
    assert read_spacecraft(tmp_path / "brick.json").joints == ()


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (("joints", 1, "parent"), "hinge", "joint 'wing': no joint before it is its parent 'hinge'"),
        (("joints", 1, "name"), "boom", "two joints are named 'boom'"),
        (("joints", 0, "axis_body"), [1.0, 1.0, 0.0], "joints.0.axis_body: should have length 1"),
        (("joints", 0, "kind"), "ball", "joints.0.kind"),
        (("part_joints", "x+"), "hinge", "part_joints: there is no joint 'hinge'"),
        (("part_joints", "door"), "wing", "part_joints: there is no part 'door'"),
        (("keypoint_joints", "Q"), "wing", "keypoint_joints: there is no keypoint 'Q'"),
    ],
)
def test_a_damaged_file_is_one_clear_line(tmp_path, key, value, words):
    write_spacecraft(winged(), tmp_path)
    path = tmp_path / "brick.json"
    record = json.loads(path.read_text())
    place = record
    for step in key[:-1]:
        place = place[step]
    place[key[-1]] = value
    path.write_text(json.dumps(record))
    with pytest.raises(posse.InputError, match=r"brick\.json") as raised:
        read_spacecraft(path)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.fixture
def folder(tmp_path) -> Path:
    folder = cuboid.write_dataset(tmp_path / "d")
    (folder / "bodies/companion").mkdir(parents=True)
    plate = cuboid.cuboid("plate", np.array([2.0, 1.0, 0.1]))
    write_spacecraft(plate, folder / "bodies/companion")
    return folder


def test_a_dataset_knows_its_bodies(folder):
    dataset = posse.Dataset(folder)
    assert list(dataset.bodies) == ["companion"]
    assert dataset.bodies["companion"].name == "plate"
    assert np.ptp(dataset.body_mesh("companion").vertices_body_m, axis=0).tolist() == [4, 2, 0.2]
    assert list(dataset.spacecraft_by_name) == ["brick"]
    with pytest.raises(posse.InputError, match="no body 'compagnon'; did you mean 'companion'"):
        dataset.body_mesh("compagnon")


def test_a_body_is_one_spacecraft(folder):
    write_spacecraft(cuboid.cuboid(), folder / "bodies/companion")
    with pytest.raises(posse.InputError, match=r"companion: has 2 files NAME\.json; one is needed"):
        posse.Dataset(folder)
    assert read_bodies(folder / "none") == {}


def test_labels_of_joints_and_bodies_come_back(folder):
    lines = cuboid.read_lines(folder)
    joints = {
        "wing": {
            "value": 0.5,
            "rate": -0.01,
            "q_cam_from_link": [1.0, 0.0, 0.0, 0.0],
            "t_link_cam_m": [0.0, 0.0, 5.0],
        }
    }
    own = ("spacecraft", "box_visible_px", "q_cam_from_body", "t_body_cam_m", "range_m")
    body = {key: lines[1][key] for key in own} | {"joints": joints, "is_carried": True}
    reading = {
        "t_s": 0.0,
        "q_sensor_from_body": [1.0, 0.0, 0.0, 0.0],
        "t_body_sensor_m": [0.0, 0.0, 5.0],
        "v_body_sensor_m_s": [0.0, 0.0, 0.0],
        "omega_body_rad_s": [0.0, 0.0, 0.0],
        "omega_sensor_rad_s": [0.0, 0.0, 0.0],
        "files": [],
        "labels": {},
    }
    beside = {
        **{key: value for key, value in reading.items() if key not in ("t_s", "files", "labels")},
        "joints": {"wing": {"value": 0.5, "rate": -0.01}},
    }
    del beside["omega_sensor_rad_s"]
    moving = {
        **reading,
        "joints": {"wing": {"value": 0.4, "rate": 0.0}},
        "bodies": {"companion": beside},
    }
    lines[0] |= {
        "joints": joints,
        "bodies": {"companion": body},
        "sensors": {"plain": [reading], "moving": [moving]},
    }
    cuboid.write_lines(folder, lines)
    dataset = posse.Dataset(folder)
    line = dataset[0]
    assert json.loads(line.to_json()) == lines[0]
    assert line.bodies["companion"].joints["wing"].value == 0.5
    assert line.sensors["moving"][0].bodies["companion"].joints["wing"].rate == -0.01
    assert not line.sensors["moving"][0].bodies["companion"].is_carried
    row = dataset.dataframe().iloc[0]
    assert row["joint_wing_value"] == 0.5
    assert row["joint_wing_t_link_cam_z_m"] == 5
    assert row["body_companion_range_m"] == lines[1]["range_m"]
    assert row["body_companion_joint_wing_rate"] == -0.01
    assert row["body_companion_spacecraft"] == "brick"


def test_collect_takes_bodies_along_and_refuses_others_of_their_name(folder, tmp_path):
    collect([posse.Dataset(folder)], [], None, tmp_path / "new", lambda labels, count: labels)
    for name in ("plate.json", "plate.ply"):
        path = f"bodies/companion/{name}"
        assert (tmp_path / "new" / path).read_bytes() == (folder / path).read_bytes()
        assert path in posse.Dataset(tmp_path / "new").manifest.sha256
    shutil.copytree(folder, tmp_path / "other")
    write_spacecraft(cuboid.cuboid("plate"), tmp_path / "other/bodies/companion")
    both = [posse.Dataset(folder), posse.Dataset(tmp_path / "other")]
    with pytest.raises(posse.InputError, match="its body 'companion' is not that of"):
        collect(both, [], None, tmp_path / "joined", lambda labels, count: labels)


def test_a_run_writes_its_bodies_and_refuses_others(tmp_path):
    plugins = load_plugins()
    scenario = load_scenario("aqua", plugins.registry)

    def begun(*bodies: str, resume: bool) -> None:
        beside = tuple(Body(name, winged()) for name in bodies)
        scene = Scene(cuboid.cuboid("target"), cuboid.CAMERA, beside)
        with recording(str(tmp_path / "d"), scenario, scene, 2, plugins, resume=resume) as dataset:
            (dataset.folder / "labels/shard-00000.jsonl").touch()

    begun("arm", "companion", resume=False)
    bodies = posse.Dataset(tmp_path / "d").bodies
    assert {name: info.name for name, info in bodies.items()} == {"arm": "brick", "companion": "brick"}
    assert bodies["arm"].part_joints == {"x-": "boom", "x+": "wing"}
    begun("arm", "companion", resume=True)
    with pytest.raises(posse.InputError, match="bodies/companion is no file of this run"):
        begun("arm", resume=True)
    (tmp_path / "d/bodies/arm/other.ply").touch()
    with pytest.raises(posse.InputError, match=r"bodies/arm/other\.ply is no file of this run"):
        begun("arm", "companion", resume=True)
