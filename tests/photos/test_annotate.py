"""``posse annotate`` on frames that POSSE made, whose poses are known."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from posse_core import open_dataset
from posse_core._cli.import_poses import command as import_poses
from posse_core._cli.validate import command as validate
from posse_core._dataset.camera import read_camera
from posse_core._errors import CheckFailed, InputError


def run(command, *arguments):
    return CliRunner().invoke(command, list(map(str, arguments)))


def true_pose(line):
    w, x, y, z = line["q_cam_from_body"]
    return Rotation.from_quat([x, y, z, w]), np.array(line["t_body_cam_m"])


@pytest.fixture
def labelled(photos, annotate, write_points):
    points = photos.points(np.random.default_rng(8))
    assert min(map(len, points.values())) >= 6
    done = annotate("--points", write_points(points), "--sigma-px", 0.5)
    assert done.exit_code == 0, (done.output, done.exception)
    return photos.folder / "labelled"


def test_poses_come_back_within_their_covariance(photos, labelled):
    records = json.loads((labelled / "poses.json").read_text())
    assert len(records) == 3
    for record in records:
        R, t = true_pose(photos.labels[record["filename"].removeprefix("images/")])
        w, x, y, z = record["q_cam_from_body"]
        turn = (Rotation.from_quat([x, y, z, w]) * R.inv()).as_rotvec()
        error = np.concatenate([turn, np.array(record["t_body_cam_m"]) - t])
        assert error @ np.linalg.solve(record["covariance"], error) < chi2.ppf(0.9999, 6)
        assert np.linalg.norm(turn) < np.radians(1.5)
        assert record["left_out"] == []
        assert np.abs(list(record["residuals_px"].values())).max() < 2.5


def test_the_labels_are_valid_and_read_by_other_commands(photos, labelled, tmp_path):
    for name in ("coco.json", "speed.json"):
        done = run(validate, labelled / name)
        assert done.exit_code == 0, done.output
    dataset = open_dataset(labelled / "coco.json")
    records = json.loads((labelled / "poses.json").read_text())
    assert dataset.camera.matrix == pytest.approx(read_camera(photos.camera).matrix)
    assert dataset.camera.distortion == read_camera(photos.camera).distortion
    for i, (line, record) in enumerate(zip(dataset, records, strict=True)):
        truth = photos.labels[line.image.removeprefix("images/")]
        assert list(line.q_cam_from_body) == record["q_cam_from_body"]
        assert list(line.t_body_cam_m) == record["t_body_cam_m"]
        assert line.range_m == pytest.approx(truth["range_m"], rel=0.02)
        assert np.abs(np.array(line.box_visible_px) - truth["box_visible_px"]).max() <= 3
        seen = {name: point for name, point in line.keypoints.items() if point.visibility}
        assert len(seen) == len(record["residuals_px"])
        for name, point in seen.items():
            assert np.hypot(*np.subtract(point[:2], truth["keypoints"][name][:2])) < 3
        assert np.array_equal(dataset.image(i), open_dataset(photos.camera.parent).image(i))
    out = tmp_path / "anew"
    done = run(import_poses, labelled / "speed.json", "--target", photos.package, "--out", out)
    assert done.exit_code == 0, (done.output, done.exception)
    assert "3 poses" in done.output
    scenario = (out / "scenario.yaml").read_text()
    assert "package" in scenario
    assert "-0.1" in scenario  # the lens


def test_the_pictures_show_the_spacecraft_where_the_photographs_do(photos, labelled):
    """The renderer of these frames fills the spacecraft's box, around which the lines must stand."""
    for name in photos.labels:
        picture = cv2.imread(str(labelled / "overlays" / f"{name}.jpg")).astype(int)
        blue, green, red = np.moveaxis(picture, -1, 0)
        lines = np.nonzero((red > 180) & (green > 180) & (blue < 150))
        filled = np.nonzero(cv2.medianBlur(picture.min(axis=-1).astype(np.uint8), 15) > 12)
        for seen, drawn in zip(filled, lines, strict=True):
            # Crosses of keypoints stand out by 8 pixels of the picture.
            assert drawn.min() == pytest.approx(seen.min(), abs=16)
            assert drawn.max() == pytest.approx(seen.max(), abs=16)
            assert np.ptp(drawn) > 200


def test_an_exchanged_pair_is_told_by_photograph_and_names(photos, annotate, write_points):
    points = photos.points()
    first = points["000000.png"]
    one, other = list(first)[:2]
    first[one], first[other] = first[other], first[one]
    done = annotate("--points", write_points(points))
    assert isinstance(done.exception, CheckFailed)
    (told,) = (text for text in done.output.splitlines() if text.startswith("posse: "))
    assert told.startswith("posse: warning: 000000.png: ")
    assert "exchanged" in told
    assert {one, other} <= set(told.split())
    # The poses are written all the same, that of the first photograph without the two.
    records = json.loads((photos.folder / "labelled" / "poses.json").read_text())
    assert [len(record["left_out"]) for record in records] == [2, 0, 0]


def test_photographs_without_a_pose_are_told_and_left_out(photos, annotate, write_points):
    points = photos.points()
    points["000001.png"] = dict(list(points["000001.png"].items())[:3])
    done = annotate("--points", write_points(points))
    assert isinstance(done.exception, CheckFailed)
    assert "posse: warning: 000001.png: has 3 of the 4 points" in done.output
    speed = json.loads((photos.folder / "labelled" / "speed.json").read_text())
    assert [entry["filename"] for entry in speed] == ["images/000000.png", "images/000002.png"]
    del points["000001.png"], points["000002.png"]
    done = annotate("--points", write_points(points), "--json")
    assert done.exit_code == 0, done.output
    assert len(json.loads(done.stdout)) == 1
    assert [path.name for path in (photos.folder / "labelled" / "images").iterdir()] == ["000000.png"]


def test_the_page_is_written_with_the_command_to_run_next(photos, annotate):
    done = annotate()
    assert done.exit_code == 0, done.output
    text = (photos.folder / "annotate.html").read_text()
    command = done.output.splitlines()[-1]
    assert command.endswith("--points points.json")
    assert json.dumps(command) in text
    assert "000002.png" in text


def change_size(photos):
    image = cv2.imread(str(photos.folder / "000001.png"))
    cv2.imwrite(str(photos.folder / "000001.png"), image[:-1])


def turn_by_exif(photos):
    with Image.open(photos.folder / "000001.png") as image:
        exif = Image.Exif()
        exif[0x0112] = 3  # turned by half a turn, so the size stays
        image.convert("RGB").save(photos.folder / "000003.jpg", exif=exif)


def add_tiff(photos):
    (photos.folder / "a.tif").write_bytes(b"II")


def empty(photos):
    for path in photos.folder.iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (change_size, ("000001.png", "800 × 599", "800 × 600")),
        (turn_by_exif, ("000003.jpg", "EXIF")),
        (add_tiff, ("a.tif", "PNG")),
        (empty, ("has no photographs",)),
    ],
)
def test_photographs_that_mislead_are_refused(photos, annotate, change, words):
    change(photos)
    done = annotate()
    assert isinstance(done.exception, InputError)
    for word in words:
        assert word in str(done.exception)
    assert not (photos.folder / "annotate.html").exists()


@pytest.mark.parametrize(
    ("photo", "spacecraft", "name", "place", "word"),
    [
        ("000000.png", "other", "B1", [1, 2], "'other'"),
        ("one.png", "craft", "B1", [1, 2], "no photograph 'one.png'"),
        ("000000.png", "craft", "Q1", [1, 2], "no keypoint 'Q1'"),
        ("000000.png", "craft", "B1", [1, 600], "outside"),
        ("000000.png", "craft", "B1", [1], "photos.000000.png.B1"),
    ],
)
def test_points_of_something_else_are_refused(
    annotate, write_points, photo, spacecraft, name, place, word
):
    done = annotate("--points", write_points({photo: {name: place}}, spacecraft))
    assert isinstance(done.exception, InputError)
    assert word in str(done.exception)
    assert "points.json" in str(done.exception)


def test_a_folder_of_something_else_is_not_replaced(photos, annotate, write_points, tmp_path):
    points = write_points(photos.points())
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("all of it")
    done = annotate("--points", points, "--out", tmp_path / "mine")
    assert isinstance(done.exception, InputError)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
    assert isinstance(annotate("--out", tmp_path / "new").exception, InputError)
    for target, word in (
        ("no/package", "posse import"),
        ("aqau", "aqua"),
        (str(tmp_path / "mine"), "spacecraft.yaml"),
    ):
        done = annotate("--target", target)
        assert isinstance(done.exception, InputError)
        assert word in str(done.exception)
