"""Each fault, planted in a clean dataset, is found in its frame, by the check that it is for."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cuboid
import cv2
import numpy as np
import planting
import pytest
from click.testing import CliRunner
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._cli.partition import command as partition
from posse_core._cli.validate import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import CheckFailed, InputError
from posse_core._evaluation.result import Report
from posse_core._evaluation.validate import validate
from posse_core._files.trajectory import save_trajectory

FRAME = 3


def prove(folder: Path) -> Report:
    return validate(Dataset(folder), lambda places, frames: places)


@pytest.fixture
def folder(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    return tmp_path / "d"


def change(folder: Path, alter: Callable[[dict[str, Any]], None], index: int = FRAME) -> None:
    """Alter one label line and sign the dataset anew, as a program that writes wrong labels would."""
    lines = cuboid.read_lines(folder)
    alter(lines[index])
    cuboid.write_lines(folder, lines)


def change_arrays(folder: Path, alter: Callable[[dict[str, np.ndarray]], None]) -> None:
    path = folder / f"truth/{FRAME:06d}.npz"
    with np.load(path) as file:
        arrays = dict(file)
    alter(arrays)
    np.savez_compressed(path, **arrays)
    cuboid.seal(folder, 6)


def assert_found(folder: Path, check: str, words: str, frame: int | None = FRAME) -> Report:
    report = prove(folder)
    result = next(result for result in report.results if result.name == check)
    assert any(fault.frame == frame and words in fault.message for fault in result.faults), result.faults
    assert not report.passed
    return report


def assert_only(report: Report, *checks: str) -> None:
    assert {result.name for result in report.results if result.faults} == set(checks)


def test_labels_of_a_reading_that_lack_a_keypoint(folder):
    """The checks that need all keypoints are not made of it."""
    cuboid.add_twin(folder)
    assert prove(folder).passed
    change(folder, lambda line: line["sensors"]["twin"][0]["labels"]["keypoints"].pop("B3"))
    report = assert_found(folder, "sensor twin", "keypoints: their names are not those of")
    assert_only(report, "sensor twin")


def test_a_clean_dataset_passes_every_check(dataset_folder):
    report = prove(dataset_folder)
    assert report.passed
    assert report.frames == 6
    unchosen = {
        "albedo",
        "flow-visible",
        "joints",
        "optical-flow",
        "partition",
        "scenario",
        "scene-flow",
    }
    assert {result.name for result in report.results if result.checked == 0} == unchosen


def test_two_crafts_in_one_list_pass(tmp_path):
    crafts = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))
    assert prove(cuboid.write_dataset(tmp_path / "d", crafts)).passed


# Poses


def test_quaternion_scalar_last(folder):
    def alter(labels):
        w, x, y, z = labels["q_cam_from_body"]
        labels["q_cam_from_body"] = [x, y, z, w] if x >= 0 else [-x, -y, -z, -w]

    change(folder, alter)
    report = assert_found(folder, "keypoints", "the quaternion is scalar-last")
    assert next(r for r in report.results if r.name == "keypoints").frames == [FRAME]


def test_rotation_of_the_other_way(folder):
    def alter(labels):
        w, x, y, z = labels["q_cam_from_body"]
        labels["q_cam_from_body"] = [w, -x, -y, -z]

    change(folder, alter)
    assert_found(folder, "keypoints", "from the camera to the body")


def test_quaternion_not_of_unit_length(folder):
    change(
        folder, lambda labels: labels.update(q_cam_from_body=[2 * x for x in labels["q_cam_from_body"]])
    )
    assert_only(assert_found(folder, "pose", "length is 2.0"), "pose")


def test_quaternion_of_the_other_sign(folder):
    change(folder, lambda labels: labels.update(q_cam_from_body=[-x for x in labels["q_cam_from_body"]]))
    assert_only(assert_found(folder, "pose", "scalar part is negative"), "pose")


def test_position_in_millimetres(folder):
    change(folder, lambda labels: labels.update(t_body_cam_m=[1e3 * x for x in labels["t_body_cam_m"]]))
    report = assert_found(folder, "pose", "range_m is")
    assert {"keypoints", "mask"} <= {r.name for r in report.results if r.faults}


def test_pose_turned_by_a_tenth_of_a_degree(folder):
    def alter(labels):
        w, x, y, z = labels["q_cam_from_body"]
        turned = Rotation.from_rotvec([0, 0, np.radians(0.1)]) * Rotation.from_quat([x, y, z, w])
        x, y, z, w = turned.as_quat(canonical=True)
        labels["q_cam_from_body"] = [w, x, y, z]

    change(folder, alter)
    assert_found(folder, "keypoints", "px off where the pose puts it")


def test_wrong_phase_angle(folder):
    change(folder, lambda labels: labels.update(phase_angle_rad=np.pi - labels["phase_angle_rad"]))
    assert_only(assert_found(folder, "sun", "phase_angle_rad"), "sun")


# Motion


def test_all_labels_of_another_frame(folder):
    """One frame's labels and arrays under another's number: consistent, but for the trajectory."""
    lines = cuboid.read_lines(folder)
    own = ("index", "image", "truth", "t_s", "epoch_utc", "sequence", "sun_fraction_target")
    lines[FRAME] = {**lines[1], **{key: lines[FRAME][key] for key in own}}
    for name in ("images/{:06d}.png", "truth/{:06d}.npz"):
        shutil.copy(folder / name.format(1), folder / name.format(FRAME))
    cuboid.write_lines(folder, lines)
    assert_only(assert_found(folder, "trajectory", "by the trajectory's attitudes"), "trajectory")


def test_position_a_micrometre_off(folder):
    change(
        folder, lambda labels: labels["t_body_cam_m"].__setitem__(0, labels["t_body_cam_m"][0] + 1e-6)
    )
    assert_only(assert_found(folder, "trajectory", "m from the trajectory's"), "trajectory")


@pytest.mark.parametrize(
    ("key", "value"),
    [("t_s", 31.0), ("sequence", 0), ("sun_fraction_target", 0.5), ("solar_flux_w_m2", 1367.0)],
)
def test_time_and_light_of_another_frame(folder, key, value):
    change(folder, lambda labels: labels.update({key: value}))
    assert_only(assert_found(folder, "trajectory", f"{key} is {value}"), "trajectory")


def test_sun_turned_about_the_line_of_sight(folder):
    """The phase angle stays, the direction does not."""

    def alter(labels):
        w, x, y, z = labels["q_cam_from_body"]
        axis = Rotation.from_quat([x, y, z, w]).inv().apply(labels["t_body_cam_m"])
        turn = Rotation.from_rotvec(0.01 * axis / np.linalg.norm(axis))
        labels["sun_direction_body"] = turn.apply(labels["sun_direction_body"]).tolist()

    change(folder, alter)
    report = assert_found(folder, "trajectory", "sun_direction_body")
    assert_only(report, "trajectory", "sunlight")  # two sides of the brick are lit at grazing angles


def test_trajectory_missing_or_too_short(folder):
    lines = cuboid.read_lines(folder)
    save_trajectory(cuboid.trajectory(lines[:FRAME]), folder / "trajectory.npz")
    cuboid.seal(folder, 6)
    assert_only(assert_found(folder, "trajectory", "the trajectory has 3 frames"), "trajectory")
    (folder / "trajectory.npz").unlink()
    assert_found(folder, "trajectory", "trajectory.npz", frame=None)


# Keypoints


def test_keypoints_shifted_by_one_pixel(folder):
    def alter(labels):
        labels["keypoints"] = {k: [u + 1, v, s] for k, (u, v, s) in labels["keypoints"].items()}

    change(folder, alter)
    assert_only(assert_found(folder, "keypoints", "shifted by (1.00, 0.00) px"), "keypoints")


def test_keypoints_of_pixel_corners(folder):
    """Half a pixel: the centre of the top-left pixel taken as (0.5, 0.5)."""

    def alter(labels):
        labels["keypoints"] = {k: [u + 0.5, v + 0.5, s] for k, (u, v, s) in labels["keypoints"].items()}

    change(folder, alter)
    assert_found(folder, "keypoints", "shifted by (0.50, 0.50) px")


def test_mirrored_x(folder):
    def alter(labels):
        labels["keypoints"] = {k: [159 - u, v, s] for k, (u, v, s) in labels["keypoints"].items()}

    change(folder, alter)
    assert_found(folder, "keypoints", "x is mirrored")


def test_y_upward(folder):
    def alter(labels):
        labels["keypoints"] = {k: [u, 119 - v, s] for k, (u, v, s) in labels["keypoints"].items()}

    change(folder, alter)
    assert_found(folder, "keypoints", "y is mirrored")


def test_two_keypoints_exchanged(folder):
    def alter(labels):
        points = labels["keypoints"]
        points["B1"], points["T4"] = points["T4"], points["B1"]

    change(folder, alter)
    assert_found(folder, "keypoints", "px off")


def test_hidden_keypoint_labelled_seen(folder):
    change(folder, lambda labels: labels["keypoints"]["B4"].__setitem__(2, 2))  # behind the craft
    assert_only(assert_found(folder, "visibility", "B4 is labelled seen"), "visibility")


def test_seen_keypoint_labelled_hidden(folder):
    change(folder, lambda labels: labels["keypoints"]["B1"].__setitem__(2, 1))
    assert_only(assert_found(folder, "visibility", "B1 is labelled hidden"), "visibility")


def test_keypoint_out_of_the_image_labelled_in_it(folder):
    change(folder, lambda labels: labels["keypoints"]["B3"].__setitem__(2, 1), index=2)
    assert_found(folder, "keypoints", "B3 is outside the image, and its visibility is 1", frame=2)


def test_keypoint_missing(folder):
    change(folder, lambda labels: labels["keypoints"].pop("T2"))
    assert_only(assert_found(folder, "schema", "names are not those"), "schema")


# Masks and boxes


def rle(mask: np.ndarray) -> dict[str, Any]:
    coded = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    return {"size": list(mask.shape), "counts": coded["counts"].decode()}


def mask_of(folder: Path, index: int) -> np.ndarray:
    with np.load(folder / f"truth/{index:06d}.npz") as file:
        return file["part_id"] >= 0


def test_mask_from_another_frame(folder):
    other = cuboid.read_lines(folder)[1]
    change(folder, lambda labels: labels.update(mask_rle=other["mask_rle"]))
    report = assert_found(folder, "mask", "not the mesh's outline")
    assert {"mask", "box", "parts", "depth", "normals"} == {r.name for r in report.results if r.faults}


def test_mask_box_and_arrays_together_one_pixel_off(folder):
    """Consistent among themselves, so only the mesh and the pose can tell."""

    def alter(labels):
        labels["mask_rle"] = rle(np.roll(mask_of(folder, FRAME), 1, axis=1))
        labels["box_visible_px"][0] += 1

    change(folder, alter)
    change_arrays(
        folder, lambda arrays: arrays.update({k: np.roll(a, 1, axis=1) for k, a in arrays.items()})
    )
    report = assert_found(folder, "mask", "not the mesh's outline")
    assert_only(report, "mask", "parts", "depth", "normals")


def test_mask_that_is_its_box(folder):
    def alter(labels):
        x, y, width, height = labels["box_visible_px"]
        mask = np.zeros((120, 160), dtype=bool)
        mask[y : y + height, x : x + width] = True
        labels.update(mask_rle=rle(mask), mask_area_px=width * height)

    change(folder, alter)
    assert_found(folder, "mask", "not the mesh's outline")


def test_wrong_area(folder):
    change(folder, lambda labels: labels.update(mask_area_px=labels["mask_area_px"] - 1))
    assert_only(assert_found(folder, "mask", "mask_area_px"), "mask")


def test_box_off_by_a_pixel(folder):
    change(
        folder, lambda labels: labels["box_visible_px"].__setitem__(2, labels["box_visible_px"][2] - 1)
    )
    assert_only(assert_found(folder, "box", "the mask's box is"), "box")


def test_box_where_nothing_is_seen(folder):
    change(folder, lambda labels: labels.update(box_visible_px=[0, 0, 1, 1]), index=5)
    assert_only(assert_found(folder, "box", "the mask's box is None", frame=5), "box")


def test_whole_box_clipped_to_the_image(folder):
    def alter(labels):
        x, _, width, _ = labels["box_whole_px"]
        labels["box_whole_px"][2] = 159 - x
        assert x + width > 160

    change(folder, alter, index=2)
    assert_only(assert_found(folder, "whole-box", "the projected mesh's is", frame=2), "whole-box")


def test_share_that_is_seen(folder):
    change(folder, lambda labels: labels.update(fraction_visible=0.9))
    assert_only(assert_found(folder, "mask", "fraction_visible is 0.9"), "mask")


def test_damaged_run_lengths(folder):
    change(folder, lambda labels: labels["mask_rle"].update(counts=labels["mask_rle"]["counts"][:-1]))
    assert_only(assert_found(folder, "schema", "run lengths"), "schema")


# Arrays


def test_wrong_depth_scale(folder):
    change_arrays(folder, lambda arrays: arrays.update(depth_m=arrays["depth_m"] * np.float32(1.001)))
    assert_only(assert_found(folder, "depth", "median ratio 1.001"), "depth")


def test_depth_along_the_ray(folder):
    def alter(arrays):
        v, u = np.mgrid[:120, :160]
        x = np.stack([(u - 79.5) / 150, (v - 59.5) / 150, np.ones((120, 160))], axis=-1)
        arrays["depth_m"] = (arrays["depth_m"] * np.linalg.norm(x, axis=-1)).astype(np.float32)

    change_arrays(folder, alter)
    assert_found(folder, "depth", "off the mesh")


def test_depth_with_a_filled_background(folder):
    change_arrays(
        folder, lambda arrays: arrays.update(depth_m=np.nan_to_num(arrays["depth_m"], nan=0.0))
    )
    assert_only(assert_found(folder, "depth", "and the mask differ"), "depth")


def test_part_ids_exchanged(folder):
    def alter(arrays):
        arrays["part_id"] = np.where(arrays["part_id"] < 0, -1, 5 - arrays["part_id"])

    change_arrays(folder, alter)
    assert_only(assert_found(folder, "parts", "part_area_px"), "parts")


def test_part_id_beyond_the_parts(folder):
    change_arrays(folder, lambda arrays: arrays["part_id"].__setitem__(arrays["part_id"] >= 0, 6))
    assert_only(assert_found(folder, "parts", "has 6 parts"), "parts")


def test_normals_turned_away(folder):
    change_arrays(folder, lambda arrays: arrays.update(normal_cam=-arrays["normal_cam"]))
    assert_only(assert_found(folder, "normals", "away from the camera"), "normals")


def test_array_of_another_size(folder):
    change_arrays(folder, lambda arrays: arrays.update(depth_m=arrays["depth_m"][:-1]))
    assert_found(folder, "files", "array depth_m is float32 of shape (119, 160)")


def test_array_of_another_type(folder):
    change_arrays(folder, lambda arrays: arrays.update(part_id=arrays["part_id"].astype(np.float32)))
    assert_only(assert_found(folder, "files", "array part_id is float32"), "files")


# Files and lines


def test_image_missing(folder):
    (folder / f"images/{FRAME:06d}.png").unlink()
    report = assert_found(folder, "checksums", "missing")
    assert_only(report, "checksums", "files")


def test_image_cut_short(folder):
    path = folder / f"images/{FRAME:06d}.png"
    path.write_bytes(path.read_bytes()[:60])
    assert_only(assert_found(folder, "checksums", "not as it was written"), "checksums", "files")


def test_one_bit_of_an_image_flipped(folder):
    path = folder / f"images/{FRAME:06d}.png"
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    image[5, 5] ^= 1
    cv2.imwrite(str(path), image)
    assert_only(assert_found(folder, "checksums", "not as it was written"), "checksums")


def test_truth_file_damaged(folder):
    path = folder / f"truth/{FRAME:06d}.npz"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    cuboid.seal(folder, 6)
    assert_only(assert_found(folder, "files", "cannot be read"), "files")


def test_image_of_another_size(folder):
    cv2.imwrite(str(folder / f"images/{FRAME:06d}.png"), np.zeros((60, 80), dtype=np.uint8))
    cuboid.seal(folder, 6)
    assert_only(assert_found(folder, "files", "80 x 60"), "files")


def test_image_of_another_frame(folder):
    shutil.copy(folder / "images/000001.png", folder / f"images/{FRAME:06d}.png")
    cuboid.seal(folder, 6)
    assert_only(assert_found(folder, "twins", "same picture as frame 1"), "picture", "twins")


def test_file_without_a_frame(folder):
    shutil.copy(folder / "images/000001.png", folder / "images/000017.png")
    assert_only(assert_found(folder, "leftovers", "000017.png", frame=None), "leftovers")


def test_frame_missing(folder):
    lines = cuboid.read_lines(folder)
    cuboid.write_lines(folder, lines[:FRAME] + lines[FRAME + 1 :], frames=6)
    assert_found(folder, "frames", "missing")


def test_frame_that_could_not_be_made(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["frames"], manifest["failed_frames"] = 7, {"6": "renderer hung"}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert_only(assert_found(folder, "frames", "could not be made: renderer hung", frame=6), "frames")


def test_frame_labelled_twice(folder):
    lines = cuboid.read_lines(folder)
    cuboid.write_lines(folder, [*lines, lines[FRAME]], frames=6)
    assert_only(assert_found(folder, "lines", "labelled 2 times"), "lines")


def test_frame_under_two_indices(folder):
    lines = cuboid.read_lines(folder)
    cuboid.write_lines(folder, [*lines, {**lines[FRAME], "index": 6}])
    assert_found(folder, "twins", f"same moment and pose as frame {FRAME}", frame=6)


def test_torn_line_within_the_shard(folder):
    path = folder / "labels/shard-00000.jsonl"
    rows = path.read_text().splitlines(keepends=True)
    path.write_text("".join(rows[:FRAME]) + rows[FRAME][:50] + "\n" + "".join(rows[FRAME + 1 :]))
    report = assert_found(folder, "lines", "shard-00000.jsonl, line 4: not a label", frame=None)
    assert {"lines", "frames", "checksums", "leftovers"} == {r.name for r in report.results if r.faults}


def test_mesh_exchanged_after_the_run(folder):
    half = cuboid.HALF * [1, 1, 1.2]
    cuboid.write_spacecraft(cuboid.cuboid("brick", half), folder / "spacecraft")
    report = assert_found(folder, "checksums", "brick.ply: not as it was written", frame=None)
    assert {"mask", "keypoints", "whole-box"} <= {r.name for r in report.results if r.faults}


def test_camera_of_another_lens(folder):
    camera = cuboid.CAMERA
    cuboid.write_camera(
        type(camera)(160, 120, 151.0, 151.0, camera.cx_px, camera.cy_px, 0.036), folder / "camera.json"
    )
    cuboid.seal(folder, 6)
    assert_found(folder, "keypoints", "px off")


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("range_m", -4.0, "range_m"),
        ("sun_fraction_target", 1.5, "sun_fraction_target"),
        ("index", -1, ""),
        ("q_cam_from_body", [1, 0, 0], "q_cam_from_body"),
        ("t_s", "ten", "t_s"),
        ("q_cam_from_body", [0.0, 0.0, 0.0, 0.0], "all of its numbers are 0"),
        ("box_visible_px", [1.5, 2, 3, 4], "box_visible_px"),
        ("keypoints", {"B1": [1.0, 2.0, 3]}, "keypoints.B1"),
        ("spacecraft", "aqua", "has no file"),
    ],
)
def test_labels_of_a_wrong_type_or_range(folder, key, value, words):
    change(folder, lambda labels: labels.update({key: value}))
    if key == "index":
        assert_found(folder, "lines", "not a label", frame=None)
    else:
        assert_found(folder, "schema", words)


def test_a_number_that_is_none(folder):
    change(folder, lambda labels: labels.update(t_body_cam_m=[0.0, float("nan"), 8.0]))
    assert_only(
        assert_found(folder, "schema", "t_body_cam_m.1: input should be a finite number"), "schema"
    )


# The command


def test_command_prints_a_table_and_passes(dataset_folder):
    result = CliRunner().invoke(command, [str(dataset_folder)])
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()][:3] == ["check", "lines", "frames"]


def test_command_ends_with_code_1_and_names_the_frame(folder):
    change(folder, lambda labels: labels.update(mask_area_px=1))
    result = CliRunner().invoke(command, [str(folder), "--json"])
    assert isinstance(result.exception, CheckFailed)
    assert result.exception.exit_code == 1
    assert str(result.exception).endswith("mask failed in frames 3")
    report = json.loads(result.stdout)
    assert report["passed"] is False
    mask = next(check for check in report["checks"] if check["name"] == "mask")
    assert mask["frames_failed"] == [3]


def test_command_ends_with_code_2_where_there_is_no_dataset(tmp_path):
    result = CliRunner().invoke(command, [str(tmp_path / "nothing")])
    assert isinstance(result.exception, InputError)
    assert result.exception.exit_code == 2


def test_lists_of_a_partition_exchanged(folder):
    assert CliRunner().invoke(partition, [str(folder), "--split", "50/25/25"]).exit_code == 0
    assert prove(folder).passed
    planting.swapped("partition/train_images.csv", "partition/valid_images.csv")(folder)
    assert_found(folder, "partition", "train_images.csv does not list the images of train", None)
