"""Each format in the program that people read it with, against the labels and against each other."""

import csv
import json
import shutil
import tracemalloc

import cuboid
import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from scipy.spatial.transform import Rotation

from posse_core._cli.export import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._files.trajectory import load_trajectory
from posse_core._formats.coco import CocoWriter
from posse_core._formats.speed import SpeedWriter
from posse_core._formats.thesis import ThesisWriter
from posse_core._plugins.options import NoOptions

# pycocotools' own, with numpy 2
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

TWO = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))


@pytest.fixture(scope="module")
def two_crafts(tmp_path_factory):
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("two") / "d", TWO)
    CocoWriter(NoOptions()).write(Dataset(folder), folder)
    SpeedWriter(NoOptions()).write(Dataset(folder), folder)
    return folder


@pytest.fixture(scope="module")
def coco(two_crafts):
    return COCO(str(two_crafts / "coco.json"))


def test_coco_boxes_masks_and_areas_by_pycocotools(two_crafts, coco):
    lines = cuboid.read_lines(two_crafts)
    assert sorted(coco.getImgIds()) == [line["index"] for line in lines]
    annotations = coco.loadAnns(coco.getAnnIds())
    assert [a["id"] for a in annotations] == list(range(1, len(annotations) + 1))
    seen = [line for line in lines if line["box_visible_px"]]
    assert len(seen) == len(annotations) == 10  # the last frame of each craft shows nothing
    for line, annotation in zip(seen, annotations, strict=True):
        assert coco.loadImgs(annotation["image_id"])[0]["file_name"] == line["image"]
        truth = np.load(two_crafts / line["truth"])["part_id"] >= 0
        assert np.array_equal(coco.annToMask(annotation).astype(bool), truth)
        rows, columns = np.nonzero(truth)
        x, y, width, height = annotation["bbox"]
        assert (x, y) == (columns.min(), rows.min())
        assert (x + width - 1, y + height - 1) == (columns.max(), rows.max())
        assert annotation["area"] == truth.sum()


def test_coco_images_exist_and_have_the_size(two_crafts, coco):
    for image in coco.loadImgs(coco.getImgIds()):
        pixels = cv2.imread(str(two_crafts / image["file_name"]), cv2.IMREAD_UNCHANGED)
        assert pixels.shape == (image["height"], image["width"])


def test_coco_categories_name_the_craft_of_each_frame(two_crafts, coco):
    lines = cuboid.read_lines(two_crafts)
    for annotation in coco.loadAnns(coco.getAnnIds()):
        category = coco.loadCats(annotation["category_id"])[0]
        assert category["name"] == lines[annotation["image_id"]]["spacecraft"]
        assert category["keypoints"] == list(cuboid.NAMES)
        pairs = [(cuboid.NAMES[a - 1], cuboid.NAMES[b - 1]) for a, b in category["skeleton"]]
        assert pairs == [("B1", "B2"), ("B1", "T1"), ("T1", "T2")]


def test_coco_keypoints_meet_speed_poses(two_crafts, coco):
    """R = Rotation.from_quat([q1, q2, q3, q0]) and x_cam = R x_body + r, as SPEED's own readers do."""
    poses = {pose["filename"]: pose for pose in json.loads((two_crafts / "speed.json").read_text())}
    assert len(poses) == 12
    crafts = Dataset(two_crafts).spacecraft_by_name
    K = np.array(json.loads((two_crafts / "camera.json").read_text())["cameraMatrix"])
    visibilities = set()
    for annotation in coco.loadAnns(coco.getAnnIds()):
        pose = poses[coco.loadImgs(annotation["image_id"])[0]["file_name"]]
        q = pose["q_vbs2tango_true"]
        R = Rotation.from_quat([q[1], q[2], q[3], q[0]]).as_matrix()
        category = coco.loadCats(annotation["category_id"])[0]
        points = np.array([crafts[category["name"]].keypoints_body_m[k] for k in category["keypoints"]])
        x_cam = points @ R.T + pose["r_Vo2To_vbs_true"]
        uv = (x_cam / x_cam[:, 2:]) @ K[:2].T
        labelled = np.array(annotation["keypoints"]).reshape(-1, 3)
        outside = (uv < -0.5).any(axis=1) | (uv >= [159.5, 119.5]).any(axis=1)
        assert np.array_equal(labelled[:, 2] == 0, outside)
        assert np.all(labelled[outside] == 0)
        assert np.abs(labelled[~outside, :2] - uv[~outside]).max() < 0.01
        assert annotation["num_keypoints"] == (~outside).sum()
        visibilities |= set(labelled[:, 2])
    assert visibilities == {0, 1, 2}


@pytest.mark.parametrize("kind", ["bbox", "segm", "keypoints"])
def test_the_truth_scores_full_marks_in_cocoeval(coco, kind):
    results = [{**annotation, "score": 1.0} for annotation in coco.loadAnns(coco.getAnnIds())]
    evaluation = COCOeval(coco, coco.loadRes(results), kind)
    if kind == "keypoints":
        evaluation.params.kpt_oks_sigmas = np.array(coco.loadCats(1)[0]["sigmas"])
    evaluation.evaluate()
    evaluation.accumulate()
    evaluation.summarize()
    assert evaluation.stats[0] == pytest.approx(1.0)


def test_coco_without_the_box_annotator_names_it(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    lines = cuboid.read_lines(dataset_folder)
    del lines[4]["box_visible_px"]
    cuboid.write_lines(tmp_path / "d", lines)
    with pytest.raises(InputError, match=r"frame 4 has no 'box_visible_px'.*add 'box'"):
        CocoWriter(NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)
    assert not (tmp_path / "coco.json").exists()


@pytest.fixture(scope="module")
def thesis_files(dataset_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("thesis") / "d"
    shutil.copytree(dataset_folder, folder)
    paths = ThesisWriter(NoOptions()).write(Dataset(folder), folder)
    assert sorted(path.name for path in paths) == sorted(
        path.name for path in (folder / "posse").iterdir()
    )
    return folder


def read_csv(path):
    with open(path, newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(row, *names):
    return np.array([float(row[name]) for name in names])


def test_thesis_pose_puts_the_keypoints_where_the_annotations_have_them(thesis_files):
    annotations = json.loads((thesis_files / "posse/annotations.json").read_text())
    info = Dataset(thesis_files).spacecraft
    for row in read_csv(thesis_files / "posse/dataset.csv"):
        assert row["spacecraft"] == "brick"
        q = numbers(row, *(f"q_body_from_cam_{axis}" for axis in "xyzw"))
        camera = numbers(row, "camera_body_x_m", "camera_body_y_m", "camera_body_z_m")
        for name, (u, v, _) in annotations["keypoints"][row["filename"]].items():
            seen = Rotation.from_quat(q).inv().apply(info.keypoints_body_m[name] - camera)
            uv = cuboid.CAMERA.matrix @ seen / seen[2]
            assert uv[:2] == pytest.approx([u, v], abs=0.01)


def test_thesis_box_anchors_are_the_first_and_last_pixel(thesis_files):
    annotations = json.loads((thesis_files / "posse/annotations.json").read_text())
    assert set(annotations) == {"keypoints", "bounding_box"}
    for index in range(6):
        mask = np.load(thesis_files / f"truth/{index:06d}.npz")["part_id"] >= 0
        anchors = annotations["bounding_box"][f"images/{index:06d}.png"]
        if not mask.any():
            assert anchors is None
            continue
        rows, columns = np.nonzero(mask)
        assert anchors == [[columns.min(), rows.min()], [columns.max(), rows.max()]]


def test_thesis_points_have_the_eight_outputs_of_its_propagator(thesis_files):
    trajectory = load_trajectory(thesis_files / "trajectory.npz")
    rows = read_csv(thesis_files / "posse/points.csv")
    assert len(rows) == 6
    for i, row in enumerate(rows):
        r, t, n = trajectory.r_chaser_rtn_m[i]
        range_m = float(row["camera_range_m"])
        # V-bar along the track, H-bar against the orbit's normal, R-bar to the Earth (Section 2.2).
        lvlh = numbers(row, "camera_lvlh_x", "camera_lvlh_y", "camera_lvlh_z")
        assert lvlh * range_m == pytest.approx([t, -n, -r])
        assert np.linalg.norm(lvlh) == pytest.approx(1)
        sun = numbers(row, "sun_eci_x_m", "sun_eci_y_m", "sun_eci_z_m")
        earth = numbers(row, "earth_eci_x_m", "earth_eci_y_m", "earth_eci_z_m")
        assert earth == pytest.approx(-trajectory.r_target_eci_m[i])
        assert sun - earth == pytest.approx(trajectory.r_sun_eci_m[i])
        q = numbers(row, *(f"q_eci_from_body_{axis}" for axis in "wxyz"))
        assert q == pytest.approx(trajectory.q_eci_from_body[i])
        assert float(row["sun_visibility"]) == pytest.approx(1 - i / 100)
        assert float(row["solar_flux_w_m2"]) == 1361
        assert float(row["earth_reflected_w_m2"]) == pytest.approx(30 * i)
        assert float(row["earth_rotation_rad"]) == pytest.approx(trajectory.earth_rotation_rad[i])


def test_pose_data_is_the_dataset_list_without_the_name(thesis_files):
    poses = read_csv(thesis_files / "posse/pose_data.csv")
    rows = read_csv(thesis_files / "posse/dataset.csv")
    assert poses == [{k: v for k, v in row.items() if k != "spacecraft"} for row in rows]


def test_writers_do_not_hold_the_frames(tmp_path):
    folder = cuboid.write_dataset(tmp_path / "d")
    line = cuboid.read_lines(folder)[0]
    many = [{**line, "index": i, "padding": {"text": "x" * 20_000}} for i in range(250)]
    cuboid.write_lines(folder, many)
    dataset = Dataset(folder)
    tracemalloc.start()
    CocoWriter(NoOptions()).write(dataset, folder)
    SpeedWriter(NoOptions()).write(dataset, folder)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000  # the lines have 5 MB
    assert len(json.loads((folder / "coco.json").read_text())["annotations"]) == 250


def run(*arguments):
    return CliRunner().invoke(command, [str(a) for a in arguments])


def test_export_prints_what_it_wrote(dataset_folder, tmp_path):
    result = run(dataset_folder, "--format", "coco", "--format", "speed", "--out", tmp_path / "new/out")
    assert result.exit_code == 0
    out = tmp_path / "new/out"
    assert result.stdout.splitlines() == [str(out / "coco.json"), str(out / "speed.json")]
    assert sorted(path.name for path in out.iterdir()) == ["coco.json", "speed.json"]


def test_export_of_an_unknown_format_names_the_nearest_and_writes_nothing(dataset_folder, tmp_path):
    result = run(dataset_folder, "--format", "cocoo", "--out", tmp_path / "out")
    assert isinstance(result.exception, InputError)
    assert "did you mean 'coco'" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_export_of_a_run_that_has_not_ended_is_refused(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    (tmp_path / "d/manifest.json").unlink()
    result = run(tmp_path / "d", "--format", "coco")
    assert isinstance(result.exception, InputError)
    assert "has not ended" in str(result.exception)
    assert not (tmp_path / "d/coco.json").exists()
