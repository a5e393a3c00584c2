"""Faults planted in datasets of joints and several bodies are found, and clean ones have none.

Labels are the program's own, of states given by hand; what finds the faults shares no code with it.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cuboid
import moving_worlds
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._annotators import rle
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.spacecraft import SpacecraftInfo, write_spacecraft
from posse_core._errors import InputError
from posse_core._evaluation.placed import PlacedBody
from posse_core._evaluation.result import Report
from posse_core._evaluation.validate import validate
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import PixelBox
from posse_core._model.craft_state import BodyState
from posse_core._model.distortion import BrownConrady
from posse_core._model.label_line import JointReading
from posse_core._model.scene import FrameState, Scene

LENS = BrownConrady(-0.1, 0.02, 0.001, -0.002)
CAMERAS = {
    "plain": cuboid.CAMERA,
    "rolling": replace(cuboid.CAMERA, line_time_s=4e-4),
    "lens": replace(cuboid.CAMERA, line_time_s=2e-4, distortion=LENS),
}
SPIN_RAD_S = {"plain": 0.02, "rolling": 0.3, "lens": 0.3}
"""So that a rolling shutter sees the bodies move by pixels."""
SCAN = {"pattern": {"shape": "raster", "columns": 30, "rows": 20}}
FRAME = 1


def prove(folder: Path) -> Report:
    return validate(Dataset(folder), lambda places, frames: places)


def faults(folder: Path) -> dict[str, list[str]]:
    """Check → its faults, each with its frame."""
    found = {result.name: result.faults for result in prove(folder).results if result.faults}
    return {name: [f"{fault.frame}: {fault.message}" for fault in each] for name, each in found.items()}


@pytest.fixture(scope="module")
def worlds(tmp_path_factory) -> Callable[[str, str], Path]:
    """Datasets by kind and camera, made when first asked for; not to be changed."""
    made: dict[tuple[str, str], Path] = {}

    def world(kind: str, camera: str) -> Path:
        if (kind, camera) not in made:
            scene = moving_worlds.world(kind, CAMERAS[camera])
            folder = tmp_path_factory.mktemp(f"{kind}-{camera}") / "d"
            frames = moving_worlds.states(scene, spin_rad_s=SPIN_RAD_S[camera])
            made[kind, camera] = moving_worlds.write_world(folder, scene, frames)
        return made[kind, camera]

    return world


@pytest.fixture
def copied(worlds, tmp_path) -> Callable[..., Path]:
    def copied(kind: str = "many", camera: str = "plain") -> Path:
        return Path(shutil.copytree(worlds(kind, camera), tmp_path / "d"))

    return copied


def change(folder: Path, alter: Callable[[dict[str, Any]], None]) -> None:
    """Alter one label line, and sign the dataset anew."""
    lines = cuboid.read_lines(folder)
    alter(lines[FRAME])
    moving_worlds.write_lines(folder, lines)


def change_arrays(folder: Path, alter: Callable[[dict[str, np.ndarray]], None]) -> None:
    path = folder / f"truth/{FRAME:06d}.npz"
    with np.load(path) as file:
        arrays = dict(file)
    alter(arrays)
    np.savez_compressed(path, **arrays)
    cuboid.seal(folder, 3)


def relabel(folder: Path, scene: Scene, alter: Callable[[FrameState], FrameState]) -> None:
    """Give a frame the labels and arrays of another state, as a program with a wrong state would: all
    of them agree with one another."""
    frames = moving_worlds.states(scene)
    frames[FRAME] = replace(alter(frames[FRAME]), onward=frames[FRAME].onward)
    other = moving_worlds.write_world(folder.parent / "other", scene, frames)
    shutil.copy(other / f"truth/{FRAME:06d}.npz", folder / "truth")
    wrong = cuboid.read_lines(other)[FRAME]
    change(folder, lambda line: line.update(wrong))


# Clean datasets


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("kind", ["rigid", "joints", "many"])
def test_clean_worlds_have_no_faults(worlds, kind, camera):
    report = prove(worlds(kind, camera))
    assert not [fault for result in report.results for fault in result.faults]
    unchosen = {"partition", "picture", "scenario"} | ({"joints"} if kind == "rigid" else set())
    assert {result.name for result in report.results if result.checked == 0} == unchosen


def test_the_bodies_hide_one_another(worlds):
    """Else the tests below would prove little."""
    for line in cuboid.read_lines(worlds("many", "plain")):
        shares = [each["fraction_visible"] for each in (line, *line["bodies"].values())]
        assert all(0.1 < share <= 1 for share in shares)
        assert min(shares) < 0.9
        seen = [k[2] for each in (line, *line["bodies"].values()) for k in each["keypoints"].values()]
        assert {1, 2} <= set(seen)


@pytest.mark.parametrize("left_out", ["parts", "pose", "mask"])
def test_labels_that_were_not_chosen_are_not_asked_for(tmp_path, left_out):
    scene = moving_worlds.world("many", cuboid.CAMERA)
    chosen = [name for name in moving_worlds.ANNOTATORS if name != left_out]
    folder = moving_worlds.write_world(
        tmp_path / "d", scene, moving_worlds.states(scene, 2), annotators=chosen
    )
    assert faults(folder) == {}


@pytest.mark.parametrize("kind", ["joints", "many"])
def test_a_clean_scan_of_moving_links_has_no_faults(tmp_path, kind):
    scene = moving_worlds.world(kind, cuboid.CAMERA)
    frames = moving_worlds.states(scene, 2, spin_rad_s=0.3)
    folder = moving_worlds.write_world(tmp_path / "d", scene, frames, annotators=("pose",), scanner=SCAN)
    assert faults(folder) == {}
    with np.load(folder / "sensors/scanner/000000.npz") as scan:
        assert len(np.unique(scan["part_id"])) > 3


# Joints


def turned(line: dict[str, Any], name: str, by_rad: float) -> None:
    line["joints"][name]["value"] += by_rad


def test_an_angle_a_degree_off_its_link(copied):
    folder = copied("joints")
    change(folder, lambda line: turned(line, "wing", np.radians(1)))
    found = faults(folder)
    assert "1: wing: q_cam_from_link is 1° from where pose and values put it" in found["joints"]
    assert "1: slide: q_cam_from_link is 1° from where pose and values put it" in found["joints"]
    assert {"keypoints", "joints", "normals"} <= found.keys()


def test_an_angle_and_its_links_a_degree_off_the_image(copied):
    """Only mesh and arrays can tell: the labels of the joints agree with one another."""
    folder = copied("joints")

    def alter(line):
        turned(line, "wing", np.radians(1))
        body = placed_by(line, moving_worlds.winged())
        for link, name in enumerate(("wing", "slide"), 1):
            R, t_m = body.link_pose(link)
            q = Rotation.from_matrix(R).as_quat(canonical=True)
            line["joints"][name] |= {"q_cam_from_link": q[[3, 0, 1, 2]].tolist()}
            line["joints"][name] |= {"t_link_cam_m": t_m.tolist()}

    change(folder, alter)
    found = faults(folder)
    assert "joints" not in found
    assert {"keypoints", "depth", "normals", "whole-box", "optical-flow", "scene-flow"} <= found.keys()
    assert all(message.startswith("1: ") for message in found["keypoints"])


def test_images_with_the_wing_a_degree_off_its_labels(copied):
    """The labels are right, the arrays and the mask are those of another angle."""
    folder = copied("joints")
    scene = moving_worlds.world("joints", cuboid.CAMERA)
    right = cuboid.read_lines(folder)[FRAME]["joints"]

    def a_degree_on(state: FrameState) -> FrameState:
        moving = state.craft.articulation
        values = moving.values + np.array([np.radians(1), 0.0])
        articulation = replace(moving, values=values)
        return replace(state, craft=replace(state.craft, articulation=articulation))

    relabel(folder, scene, a_degree_on)
    assert {"depth", "keypoints"}.isdisjoint(faults(folder))
    change(folder, lambda line: line.update(joints=right))
    assert {"depth", "keypoints", "normals", "whole-box"} <= faults(folder).keys()


def test_the_pose_of_another_link(copied):
    folder = copied("joints")

    def alter(line):
        line["joints"]["slide"]["t_link_cam_m"] = line["joints"]["wing"]["t_link_cam_m"]

    change(folder, alter)
    found = faults(folder)
    assert found.keys() == {"joints"}
    assert "1: slide: t_link_cam_m is " in found["joints"][0]


def test_a_keypoint_where_it_would_be_at_zero(copied):
    folder = copied("joints")

    def alter(line):
        body = replace(placed_by(line, moving_worlds.winged()), joints={})
        for name in ("wing", "inner", "tip"):
            x_m = moving_worlds.winged().keypoints_body_m[name]
            (uv,) = cuboid.CAMERA.project(body.in_camera(x_m[None], np.zeros(1, int)))
            line["keypoints"][name][:2] = uv.tolist()

    change(folder, alter)
    (message,) = (each for each in faults(folder)["keypoints"] if "px off" in each)
    assert message.endswith("where the pose puts it: all joints are taken as at zero")


def test_a_joint_beyond_its_limits(tmp_path):
    scene = moving_worlds.world("joints", cuboid.CAMERA)
    frames = moving_worlds.states(scene, 1)
    moving = replace(frames[0].craft.articulation, values=np.array([0.2, 0.7]))
    state = replace(frames[0], craft=replace(frames[0].craft, articulation=moving))
    folder = moving_worlds.write_world(tmp_path / "d", scene, [state])
    assert faults(folder) == {"joints": ["0: slide: value 0.7 is not within -0.6 and 0.6"]}


def test_a_wrong_rate_under_a_rolling_shutter(copied):
    folder = copied("joints", "rolling")

    def alter(line):
        line["joints"]["wing"]["rate"] *= -1

    change(folder, alter)
    found = faults(folder)
    assert {"keypoints", "scene-flow"} <= found.keys()
    assert all(message.startswith("1: ") for message in found["keypoints"])


@pytest.mark.parametrize(
    ("path", "value", "check"),
    [
        (("joints", "wing", "value"), 1e300, "joints"),
        (("joints", "wing", "t_link_cam_m", 0), 1e300, "joints"),
        (("t_body_cam_m", 2), 1e300, "schema"),
        (("fraction_visible",), None, "mask"),
    ],
)
def test_numbers_that_can_be_of_nothing(copied, path, value, check):
    folder = copied("joints")

    def alter(line):
        place = line
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value

    with np.errstate(all="ignore"):
        change(folder, alter)
        assert faults(folder)[check][0].startswith("1: ")


def test_joints_of_another_spacecraft(copied):
    folder = copied("joints")
    change(folder, lambda line: line["joints"].pop("slide"))
    assert faults(folder)["schema"] == ["1: joints: their names are not those of spacecraft/winged.json"]


# Bodies


def test_the_labels_of_two_instances_are_swapped(copied):
    """All of them, and with them their numbers, so that only the arrays can tell."""
    folder = copied()

    def alter(line):
        bodies = line["bodies"]
        line["bodies"] = {"left": bodies["right"], "right": bodies["left"], "arm": bodies["arm"]}

    change(folder, alter)
    messages = faults(folder)["parts"]
    assert any("1: left: its mask and part_id differ in" in message for message in messages)


def test_the_masks_of_two_instances_are_swapped(copied):
    folder = copied()
    own = ("mask_rle", "mask_area_px", "box_visible_px", "part_area_px")

    def alter(line):
        left, right = line["bodies"]["left"], line["bodies"]["right"]
        for key in own:
            left[key], right[key] = right[key], left[key]

    change(folder, alter)
    found = faults(folder)
    for name in ("left", "right"):
        assert any(f"1: {name}: the mask is not the mesh's" in message for message in found["mask"])


def test_ids_of_two_bodies_are_swapped_in_the_array(copied):
    folder = copied()

    def alter(arrays):
        body_id = arrays["body_id"]
        arrays["body_id"] = np.choose(body_id + 1, [-1, 0, 2, 1, 3]).astype(body_id.dtype)

    change_arrays(folder, alter)
    assert faults(folder) == {
        "parts": ["1: body_id is not there, or not the body of each pixel's part_id"]
    }


def test_parts_are_permuted_between_bodies(copied):
    """Part and body ids and areas of two instances, in agreement with one another."""
    folder = copied()
    order = np.array([0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13, -1], dtype=np.int16)
    change_arrays(
        folder,
        lambda arrays: arrays.update(
            part_id=order[arrays["part_id"]],
            body_id=np.array([0, 2, 1, 3, -1], dtype=np.int16)[arrays["body_id"]],
        ),
    )

    def alter(line):
        left, right = line["bodies"]["left"], line["bodies"]["right"]
        left["part_area_px"], right["part_area_px"] = right["part_area_px"], left["part_area_px"]

    change(folder, alter)
    messages = faults(folder)["parts"]
    assert any("part_id is not the mesh's part in" in message for message in messages)
    assert any("1: left: its mask and part_id differ in" in message for message in messages)


def test_parts_of_one_body_are_permuted(copied):
    """With their areas, so that only the mesh can tell."""
    folder = copied("joints")
    order = np.array([1, 0, 2, 3, -1], dtype=np.int16)
    change_arrays(folder, lambda arrays: arrays.update(part_id=order[arrays["part_id"]]))

    def alter(line):
        area_px = line["part_area_px"]
        line["part_area_px"] = {**area_px, "bus": area_px["wing"], "wing": area_px["bus"]}

    change(folder, alter)
    (message,) = faults(folder)["parts"]
    assert message.startswith("1: part_id is not the mesh's part in")


def whole_mask(state: FrameState, scene: Scene, number: int) -> np.ndarray:
    """(H, W) of a body without the others."""
    caster = RayCaster(Scene(scene.bodies[number], scene.camera))
    view = caster.view(replace(state.craft.about(number), others=()))
    mask = np.zeros((scene.camera.height_px, scene.camera.width_px), dtype=bool)
    mask[view.box.slices] = view.mask
    return mask


def test_occlusion_is_ignored(copied):
    """The mask of a hidden body is whole, with its area, box and share."""
    folder = copied()
    scene = moving_worlds.world("many", cuboid.CAMERA)
    state = moving_worlds.states(scene)[FRAME]
    shares = [each["fraction_visible"] for each in cuboid.read_lines(folder)[FRAME]["bodies"].values()]
    number = 1 + int(np.argmin(shares[:2]))
    name = scene.others[number - 1].name
    mask = whole_mask(state, scene, number)
    encoded = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    height_px, width_px = mask.shape
    counts = rle.encode(mask, PixelBox(0, 0, width_px, height_px), height_px, width_px)

    def alter(line):
        line["bodies"][name] |= {
            "mask_rle": {"size": [height_px, width_px], "counts": counts},
            "mask_area_px": int(mask.sum()),
            "fraction_visible": 1.0,
            "box_visible_px": [int(x) for x in coco_mask.toBbox(encoded)],
        }

    change(folder, alter)
    found = faults(folder)
    assert any(f"1: {name}: the mask is not the mesh's outline" in each for each in found["mask"])
    assert any(f"1: {name}: fraction_visible is 1, and the meshes" in each for each in found["mask"])
    assert any(f"1: {name}: its mask and part_id differ" in each for each in found["parts"])


def test_a_keypoint_that_another_body_hides_is_labelled_seen(copied):
    folder = copied()
    hidden = [
        (frame, name, key)
        for frame, line in enumerate(cuboid.read_lines(folder))
        for name, body in (("", line), *line["bodies"].items())
        for key, (_, _, visibility) in body["keypoints"].items()
        if visibility == 1
    ]
    lines = cuboid.read_lines(folder)
    for frame, name, key in hidden:
        body = lines[frame]["bodies"][name] if name else lines[frame]
        body["keypoints"][key][2] = 2
    moving_worlds.write_lines(folder, lines)
    found = faults(folder)
    assert found.keys() == {"visibility"}
    # A point may be hidden by less than the tolerance of the check: 2 % of the size of its body.
    assert len(found["visibility"]) >= len(hidden) // 2


def test_the_files_of_a_body_are_of_another_craft(copied):
    folder = copied()
    write_spacecraft(cuboid.cuboid("probe"), folder / "bodies/left")
    cuboid.seal(folder, 3)
    assert (
        "bodies.left.keypoints: their names are not those of bodies/left/probe.json"
        in (faults(folder)["schema"][0])
    )


def test_the_mesh_of_a_body_is_of_another_size(copied):
    folder = copied()
    craft = moving_worlds.winged("probe")
    parts = tuple(replace(part, vertices_body_m=part.vertices_body_m * 1.02) for part in craft.parts)
    write_spacecraft(replace(craft, parts=parts), folder / "bodies/left")
    cuboid.seal(folder, 3)
    found = faults(folder)
    assert {"depth", "whole-box"} <= found.keys()
    assert all("left: box_whole_px" in message for message in found["whole-box"])


@pytest.mark.parametrize(
    ("alter", "message"),
    [
        (lambda body: body.update(spacecraft="winged"), "spacecraft: is not 'probe'"),
        (lambda body: body.pop("keypoints"), "the target and it do not have the same labels: keypoints"),
        (lambda body: body.pop("joints"), "joints: their names are not those of bodies/left/probe.json"),
    ],
)
def test_labels_of_a_body_that_is_described_otherwise(copied, alter, message):
    folder = copied()
    change(folder, lambda line: alter(line["bodies"]["left"]))
    assert message in faults(folder)["schema"][0]


def test_a_body_without_files(copied):
    folder = copied()
    shutil.rmtree(folder / "bodies/left")
    cuboid.seal(folder, 3)
    assert faults(folder)["schema"][0] == "0: bodies.left: has no file in bodies/left/"
    with pytest.raises(InputError, match="no body 'left'"):
        Dataset(folder).body_mesh("left")


def test_a_body_that_no_run_wrote(copied):
    folder = copied()
    (folder / "bodies/stranger").mkdir()
    write_spacecraft(cuboid.cuboid(), folder / "bodies/stranger")
    assert faults(folder)["leftovers"] == [
        f"None: bodies/stranger/brick.{ending}: the manifest does not name it"
        for ending in ("json", "ply")
    ]


def test_another_sun_and_another_camera_beside_the_target(copied):
    folder = copied()

    def alter(line):
        left = line["bodies"]["left"]
        left["omega_camera_rad_s"] = left["omega_body_rad_s"]
        w, x, y, z = left["q_cam_from_body"]
        to_camera = -Rotation.from_quat([x, y, z, w]).inv().apply(left["t_body_cam_m"])
        turn = Rotation.from_rotvec(0.01 * to_camera / np.linalg.norm(to_camera))
        left["sun_direction_body"] = turn.apply(left["sun_direction_body"]).tolist()

    change(folder, alter)
    found = faults(folder)
    assert found == {
        "pose": ["1: left: omega_camera_rad_s is not that beside the target, and there is one camera"],
        "sun": ["1: left: sun_direction_body is not the direction of the Sun that the target has"],
    }


def test_a_carried_body_that_flies(copied):
    folder = copied("many", "rolling")
    change(folder, lambda line: line["bodies"]["left"].update(is_carried=True))
    found = faults(folder)
    assert "1: left: is_carried is true, and by its rates the body moves in camera axes" in found["pose"]
    change(folder, lambda line: line["bodies"]["left"].pop("is_carried"))
    assert faults(folder) == {}


# Readings


@pytest.fixture(scope="module")
def scanned(tmp_path_factory) -> Path:
    """Scans of 30 beams a row, fast enough to see the joints move; not to be changed."""
    scene = moving_worlds.world("many", cuboid.CAMERA)
    frames = moving_worlds.states(scene, 2, spin_rad_s=0.3)
    folder = tmp_path_factory.mktemp("scanned") / "d"
    return moving_worlds.write_world(folder, scene, frames, annotators=("pose",), scanner=SCAN)


@pytest.mark.parametrize(
    ("alter", "words"),
    [
        (lambda said: said["joints"]["wing"].update(value=0.0), "joint wing: value and rate are not"),
        (
            lambda said: said["bodies"]["left"]["joints"].pop("wing"),
            "its joints are not those of bodies",
        ),
        (lambda said: said["bodies"].pop("left"), "its bodies are not those of the frame"),
        (
            lambda said: said["bodies"]["left"]["t_body_sensor_m"].__setitem__(2, 6.0),
            "left: t_body_sensor_m is",
        ),
        (
            lambda said: said["bodies"]["arm"].update(q_sensor_from_body=[0.0, 0.0, 0.0, 0.0]),
            "arm: q_sensor_from_body is not a unit quaternion",
        ),
        (
            lambda said: said["bodies"]["arm"].update(
                q_sensor_from_body=said["bodies"]["left"]["q_sensor_from_body"]
            ),
            "arm: q_sensor_from_body is not the frame's attitude by the mount",
        ),
    ],
)
def test_a_reading_whose_bodies_are_elsewhere(scanned, tmp_path, alter, words):
    folder = Path(shutil.copytree(scanned, tmp_path / "d"))
    lines = cuboid.read_lines(folder)
    alter(lines[FRAME]["sensors"]["scanner"][0])
    moving_worlds.write_lines(folder, lines)
    messages = faults(folder)["sensor scanner"]
    assert any(message.startswith("1: reading 0: ") and words in message for message in messages)


def test_ranges_of_a_scan_with_the_joints_at_rest(tmp_path):
    """Labels of the rates are right, and the ranges are those of links that do not move."""
    scene = moving_worlds.world("joints", cuboid.CAMERA)
    frames = moving_worlds.states(scene, 1, spin_rad_s=1.0)
    moving = frames[0].craft.articulation
    still = replace(moving, rates=np.zeros(2))
    state = replace(frames[0], craft=replace(frames[0].craft, articulation=still))
    folder = moving_worlds.write_world(
        tmp_path / "d", scene, [state], annotators=("pose",), scanner=SCAN
    )
    assert faults(folder) == {}
    lines = cuboid.read_lines(folder)
    for said in (lines[0]["joints"], lines[0]["sensors"]["scanner"][0]["joints"]):
        for joint, rate in zip(moving.joints, moving.rates, strict=True):
            said[joint.name]["rate"] = float(rate)
    moving_worlds.write_lines(folder, lines)
    assert "true_range_m of beam" in faults(folder)["sensor scanner"][0]


# The kinematics


def info_of(craft: Any) -> SpacecraftInfo:
    return SpacecraftInfo(craft.name, (), {}, (), (), joints=craft.joints)


def placed_by(line: dict[str, Any], craft: Any) -> PlacedBody:
    w, x, y, z = line["q_cam_from_body"]
    return PlacedBody(
        info_of(craft),
        Rotation.from_quat([x, y, z, w]).as_matrix(),
        np.array(line["t_body_cam_m"]),
        *np.zeros((3, 3)),
        joints={
            name: JointReading(value=said["value"], rate=said["rate"])
            for name, said in line["joints"].items()
        },
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_referee_places_links_where_the_simulator_does(seed, is_carried):
    rng = np.random.default_rng(seed)
    scene = moving_worlds.world("joints", cuboid.CAMERA)
    craft = moving_worlds._state(scene, int(rng.integers(1000)), 0.4).craft
    body = replace(
        BodyState(craft.R_cam_from_body, craft.t_body_cam_m, craft.rates, craft.articulation),
        is_carried=is_carried,
    )
    moving = body.articulation
    placed = PlacedBody(
        info_of(scene.spacecraft),
        body.R_cam_from_body,
        body.t_body_cam_m,
        body.rates.omega_body_rad_s,
        body.rates.omega_camera_rad_s,
        body.rates.v_body_cam_m_s,
        is_carried,
        {
            joint.name: JointReading(value=float(value), rate=float(rate))
            for joint, value, rate in zip(moving.joints, moving.values, moving.rates, strict=True)
        },
    )
    x_m, links, after_s = rng.normal(size=(12, 3)), np.arange(12) % 3, rng.uniform(-1, 1, 12)
    x_cam_m = placed.in_camera(x_m, links, after_s)
    expected = [body.in_camera(x_m[i], after_s[i], int(links[i])) for i in range(12)]
    np.testing.assert_allclose(x_cam_m, expected, atol=1e-12)
    np.testing.assert_allclose(placed.in_link(x_cam_m, links, after_s), x_m, atol=1e-12)
    np.testing.assert_allclose(
        placed.in_camera(x_m, links, 0.3), placed.in_camera(x_m, links, np.full(12, 0.3)), atol=1e-14
    )
