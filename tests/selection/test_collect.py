"""Datasets joined and thinned: what is kept is the same frames, and the result proves itself."""

import dataclasses
import json
import shutil
from datetime import datetime

import cuboid
import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from posse_core._cli.collect import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.validate import validate
from posse_core._files.trajectory import load_trajectory, save_trajectory


@pytest.fixture
def two(tmp_path):
    """A dataset of a brick and one of a plate that begins an hour and a leap second later."""
    brick = cuboid.write_dataset(tmp_path / "brick")
    plate = cuboid.write_dataset(tmp_path / "plate", (("plate", np.array([2.0, 1.0, 0.1])),))
    for folder, epoch in ((brick, "2016-12-31T23:30:00"), (plate, "2017-01-01T00:30:00")):
        trajectory = load_trajectory(folder / "trajectory.npz")
        begin = datetime.fromisoformat(epoch)
        turned = cuboid.earth_rotation(trajectory.t_s, begin)
        moved = dataclasses.replace(trajectory, epoch_utc=epoch, earth_rotation_rad=turned)
        save_trajectory(moved, folder / "trajectory.npz")
        lines = cuboid.read_lines(folder)
        cuboid.write_lines(
            folder, [{**line, "epoch_utc": cuboid.instant(line["t_s"], begin)} for line in lines]
        )
    return brick, plate


def run(*arguments):
    result = CliRunner().invoke(command, [str(a) for a in arguments])
    return result


def test_joined_datasets_pass_validation_and_keep_their_frames(two, tmp_path):
    brick, plate = two
    result = run(brick, plate, "--out", tmp_path / "all")
    assert result.stdout == "kept 12\n"
    both = Dataset(tmp_path / "all")
    assert validate(both, lambda places, frames: places).passed
    assert list(both.spacecraft_by_name) == ["brick", "plate"]
    sources = cuboid.read_lines(brick) + cuboid.read_lines(plate)
    moved = ("index", "image", "truth", "t_s", "sequence", "origin")
    for index, (frame, source) in enumerate(zip(both, sources, strict=True)):
        assert frame.index == index
        assert frame.origin == (source["spacecraft"], source["index"])
        labels = json.loads(frame.to_json())
        assert {k: v for k, v in labels.items() if k not in moved} == {
            k: v for k, v in source.items() if k not in moved
        }
        own = Dataset(tmp_path / source["spacecraft"])
        assert np.array_equal(both.image(index), own.image(source["index"]))
        depth = own.truth(source["index"])["depth_m"]
        assert np.array_equal(both.truth(index)["depth_m"], depth, equal_nan=True)


def test_times_and_sequences_go_on(two, tmp_path):
    run(*two, "--out", tmp_path / "all")
    trajectory = load_trajectory(tmp_path / "all/trajectory.npz")
    assert trajectory.epoch_utc == "2016-12-31T23:30:00"
    expected = 10.0 * np.arange(6)
    assert trajectory.t_s == pytest.approx(
        [*expected, *(3601 + expected)]
    )  # an hour, and the leap second
    assert trajectory.sequence.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]
    frames = list(Dataset(tmp_path / "all"))
    assert [frame.t_s for frame in frames] == pytest.approx(trajectory.t_s.tolist())
    assert [frame.sequence for frame in frames] == trajectory.sequence.tolist()


def spoil(folder):
    """Frame 0 in eclipse for the camera, 1 with two keypoints seen, 2 dark, 3 dark and in eclipse."""
    lines = cuboid.read_lines(folder)
    lines[0]["sun_fraction_camera"] = 0.4
    for name in list(lines[1]["keypoints"])[2:]:
        lines[1]["keypoints"][name][2] = 1
    for index in (2, 3):
        image = cv2.imread(str(folder / lines[index]["image"]), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(folder / lines[index]["image"]), image // 20)
    lines[3]["sun_fraction_target"] = 0.0
    for line in lines:
        line["epoch_utc"] = cuboid.instant(line["t_s"])
    save_trajectory(cuboid.trajectory(lines), folder / "trajectory.npz")
    cuboid.write_lines(folder, lines)


def test_rules_drop_what_they_name_and_are_counted(two, tmp_path):
    brick, _ = two
    spoil(brick)
    rules = ("--drop", "dark", "--drop", "few-keypoints", "--drop", "eclipse")
    result = run(brick, "--out", tmp_path / "good", *rules, "--json")
    # The last frame shows nothing: no keypoint is seen.
    assert json.loads(result.stdout) == {"eclipse": 2, "few-keypoints": 2, "dark": 1, "kept": 1}
    good = Dataset(tmp_path / "good")
    assert [frame.origin for frame in good] == [("brick", 4)]
    selection = {each.rule: each.dropped for each in good.manifest.selection}
    assert selection == {"eclipse": 2, "few-keypoints": 2, "dark": 1}
    assert validate(good, lambda places, frames: places).passed
    row, rows = (load_trajectory(folder / "trajectory.npz") for folder in (tmp_path / "good", brick))
    assert np.array_equal(row.r_chaser_rtn_m, rows.r_chaser_rtn_m[4:5])


def test_dark_is_judged_by_the_craft_alone(two, tmp_path):
    """A bright sky does not save a dark craft, nor a black one drop a lit craft."""
    brick, _ = two
    lines = cuboid.read_lines(brick)
    for index in range(5):
        craft = np.load(brick / lines[index]["truth"])["part_id"] >= 0
        image = np.where(craft, 20, 60_000) if index % 2 else np.where(craft, 20_000, 0)
        cv2.imwrite(str(brick / lines[index]["image"]), image.astype(np.uint16))
    cuboid.seal(brick, 6)
    run(brick, "--out", tmp_path / "good", "--drop", "dark")
    assert [frame.origin[1] for frame in Dataset(tmp_path / "good")] == [0, 2, 4]


def test_a_collection_can_be_collected_again(two, tmp_path):
    run(*two, "--out", tmp_path / "all")
    run(tmp_path / "all", "--out", tmp_path / "again", "--drop", "few-keypoints")
    again = Dataset(tmp_path / "again")
    assert len(again) == 10
    assert validate(again, lambda places, frames: places).passed
    assert [source.dataset for source in again.manifest.sources[0].sources] == [
        "brick",
        "plate",
    ]


def assert_refused(result, words, folder):
    assert isinstance(result.exception, InputError), result.exception
    assert words in str(result.exception)
    assert "\n" not in str(result.exception)
    assert not list(folder.glob("*new*"))
    assert not list(folder.glob(".*"))


def test_refusals_leave_nothing_behind(two, tmp_path):
    brick, plate = two
    out = ("--out", tmp_path / "new")
    assert_refused(run(brick, *out, "--drop", "eclips"), "did you mean 'eclipse'", tmp_path)
    assert_refused(run(brick, tmp_path / "none", *out), "there is no such folder", tmp_path)
    lines = [{**line, "sun_fraction_target": 0.0} for line in cuboid.read_lines(brick)]
    cuboid.write_lines(brick, lines)
    assert_refused(run(brick, *out, "--drop", "eclipse"), "no frame is left", tmp_path)
    del lines[5]["keypoints"]
    cuboid.write_lines(brick, lines)
    assert_refused(run(brick, *out, "--drop", "few-keypoints"), "frame 5 has no 'keypoints'", tmp_path)
    camera = dataclasses.replace(cuboid.CAMERA, fx_px=151.0)
    cuboid.write_camera(camera, plate / "camera.json")
    assert_refused(run(brick, plate, *out), "its camera is not that of", tmp_path)


def test_a_damaged_file_is_not_signed_anew(two, tmp_path):
    path = two[0] / "images/000003.png"
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    assert_refused(run(two[0], "--out", tmp_path / "new"), "000003.png: missing, or changed", tmp_path)
    path.unlink()
    assert_refused(run(two[0], "--out", tmp_path / "new"), "000003.png: missing, or changed", tmp_path)


def test_two_crafts_of_one_name_are_refused(two, tmp_path):
    brick, _ = two
    shutil.copytree(brick, tmp_path / "other")
    craft = cuboid.cuboid("brick", cuboid.HALF * 1.01)
    cuboid.write_spacecraft(craft, tmp_path / "other/spacecraft")
    result = run(brick, tmp_path / "other", "--out", tmp_path / "new")
    assert_refused(result, "its 'brick' is not that of", tmp_path)


def test_a_folder_that_exists_is_not_touched(two, tmp_path):
    (tmp_path / "new").mkdir()
    (tmp_path / "new/mine.txt").write_text("mine")
    result = run(two[0], "--out", tmp_path / "new")
    assert "exists already" in str(result.exception)
    assert (tmp_path / "new/mine.txt").read_text() == "mine"


def test_frames_that_could_not_be_made_are_told(two, tmp_path):
    manifest = json.loads((two[0] / "manifest.json").read_text())
    manifest["state"] = "incomplete"
    (two[0] / "manifest.json").write_text(json.dumps(manifest))
    assert_refused(run(two[0], "--out", tmp_path / "new"), "could not be made", tmp_path)


def test_extras_that_all_sources_have_are_kept(two, tmp_path):
    brick, plate = two
    shared = np.arange(12.0).reshape(6, 2)
    for folder, extras in (
        (brick, {"own": np.zeros(6), "shared": shared}),
        (plate, {"shared": -shared}),
    ):
        trajectory = load_trajectory(folder / "trajectory.npz")
        path = folder / "trajectory.npz"
        save_trajectory(dataclasses.replace(trajectory, extras=extras), path)
    run(*two, "--out", tmp_path / "all")
    joined = load_trajectory(tmp_path / "all/trajectory.npz").extras
    assert joined.keys() == {"shared"}
    np.testing.assert_array_equal(joined["shared"], np.concatenate([shared, -shared]))
