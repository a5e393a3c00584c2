"""Two craft in one frame list, joined by `posse collect`: each export in the programs that read it.

The second craft has other keypoints than the first, and fewer, as Aqua and Cluster have. COCO is read
by pycocotools and by faster-coco-eval; SPEED, BOP and YOLO-pose by readers written from their
documents. Truth is the collected label lines, and the arrays that the cuboids' closed forms made.
"""

import json

import cuboid
import cv2
import faster_coco_eval
import numpy as np
import pycocotools.coco
import pycocotools.cocoeval
import pytest
import trimesh
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from posse_core._cli import collect, export, partition, validate

# pycocotools' own, with numpy 2
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

PLATE = np.array([2.0, 1.0, 0.1])
HALF_OF = {"brick": cuboid.HALF, "plate": PLATE}
KEPT = ("T1", "T2", "T3", "T4", "B1")
"""Of the plate's keypoints, in an order of their own."""


def with_fewer_keypoints(folder):
    path = folder / "spacecraft/plate.json"
    info = json.loads(path.read_text())
    info["keypoints"] = {name: info["keypoints"][name] for name in KEPT}
    info["skeleton"] = [["T1", "T2"], ["B1", "T1"]]
    path.write_text(json.dumps(info))
    lines = cuboid.read_lines(folder)
    for line in lines:
        line["keypoints"] = {name: line["keypoints"][name] for name in KEPT}
    cuboid.write_lines(folder, lines)
    return folder


def posse(command, *arguments):
    result = CliRunner().invoke(command, [str(a) for a in arguments])
    assert result.exit_code == 0, result.exception
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("two")
    brick = cuboid.write_dataset(where / "brick")
    plate = with_fewer_keypoints(cuboid.write_dataset(where / "plate", (("plate", PLATE),)))
    posse(collect.command, brick, plate, "--out", where / "all")
    posse(partition.command, where / "all", "--split", "60/20/20")
    formats = [word for name in ("coco", "speed", "bop", "yolo", "posse") for word in ("--format", name)]
    posse(export.command, where / "all", *formats)
    return where / "all"


@pytest.fixture(scope="module")
def lines(folder):
    return cuboid.read_lines(folder)


def test_both_are_in_the_list(lines):
    assert [line["spacecraft"] for line in lines] == ["brick"] * 6 + ["plate"] * 6


@pytest.mark.parametrize("name", ["", "coco.json", "speed.json", "bop", "yolo"])
def test_validation_passes_the_dataset_and_each_export_by_itself(folder, name):
    report = json.loads(posse(validate.command, folder / name, "--json"))
    checked = {check["name"]: check["checked"] for check in report["checks"]}
    assert all(checked[f"{kind} export"] == 12 for kind in ("bop", "coco", "speed", "yolo") if not name)
    assert all(checked.values()) or not name


@pytest.mark.parametrize("COCO", [pycocotools.coco.COCO, faster_coco_eval.COCO])
def test_coco(folder, lines, COCO):
    coco = COCO(str(folder / "coco.json"))
    names = {category["id"]: category for category in coco.loadCats(coco.getCatIds())}
    assert [names[i]["name"] for i in sorted(names)] == ["brick", "plate"]
    assert [len(names[i]["keypoints"]) for i in sorted(names)] == [8, 5]
    for id_, category in names.items():
        images = set(coco.getImgIds(catIds=[id_]))
        seen = {k["index"] for k in lines if k["spacecraft"] == category["name"] and k["box_visible_px"]}
        assert images == seen
    for annotation in coco.loadAnns(coco.getAnnIds()):
        line = lines[annotation["image_id"]]
        with np.load(folder / line["truth"]) as truth:
            assert np.array_equal(coco.annToMask(annotation) > 0, truth["part_id"] >= 0)
        points = zip(
            names[annotation["category_id"]]["keypoints"],
            np.reshape(annotation["keypoints"], (-1, 3)).tolist(),
            strict=True,
        )
        for name, point in points:
            assert point == (line["keypoints"][name] if line["keypoints"][name][2] else [0, 0, 0])


@pytest.mark.parametrize("kind", ["bbox", "segm", "keypoints"])
@pytest.mark.parametrize("tool", ["pycocotools", "faster-coco-eval"])
def test_the_truth_scores_full_marks_and_the_other_craft_none(folder, kind, tool):
    """One category at a time for keypoints, whose number the tools take to be one for all."""
    COCO, Evaluation = {
        "pycocotools": (pycocotools.coco.COCO, pycocotools.cocoeval.COCOeval),
        "faster-coco-eval": (faster_coco_eval.COCO, faster_coco_eval.COCOeval_faster),
    }[tool]
    coco = COCO(str(folder / "coco.json"))
    for swapped in (False, True) if kind == "bbox" else (False,):
        results = [{**a, "score": 1.0} for a in coco.loadAnns(coco.getAnnIds())]
        for result in results:
            result["category_id"] = 3 - result["category_id"] if swapped else result["category_id"]
        for category in coco.loadCats(coco.getCatIds()):
            evaluation = Evaluation(coco, coco.loadRes(results), kind)
            evaluation.params.catIds = [category["id"]]
            if kind == "keypoints":
                evaluation.params.kpt_oks_sigmas = np.array(category["sigmas"])
            evaluation.evaluate()
            evaluation.accumulate()
            evaluation.summarize()
            assert evaluation.stats[0] == pytest.approx(0.0 if swapped else 1.0)


def test_speed_poses_put_the_outline_of_each_craft_on_its_mask(folder, lines):
    """SPEED's own reader turns body axes by the transpose of a direction-cosine matrix of q."""
    poses = json.loads((folder / "speed.json").read_text())
    assert [pose["filename"] for pose in poses] == [line["image"] for line in lines]
    K = np.array(json.loads((folder / "camera.json").read_text())["cameraMatrix"])
    for pose, line in zip(poses, lines, strict=True):
        q0, q1, q2, q3 = pose["q_vbs2tango_true"]
        dcm = np.array(
            [
                [2 * q0**2 - 1 + 2 * q1**2, 2 * (q1 * q2 + q0 * q3), 2 * (q1 * q3 - q0 * q2)],
                [2 * (q1 * q2 - q0 * q3), 2 * q0**2 - 1 + 2 * q2**2, 2 * (q2 * q3 + q0 * q1)],
                [2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), 2 * q0**2 - 1 + 2 * q3**2],
            ]
        )
        x = cuboid.corners(HALF_OF[line["spacecraft"]]) @ dcm + pose["r_Vo2To_vbs_true"]
        assert_covers(folder, line, x @ K.T)


def assert_covers(folder, line, uvw):
    """The corners' hull holds the mask's pixels, and its middle is on the mask."""
    hull = cv2.convexHull((uvw[:, :2] / uvw[:, 2:]).astype(np.float32))
    with np.load(folder / line["truth"]) as truth:
        mask = truth["part_id"] >= 0
    inside = [cv2.pointPolygonTest(hull, (float(u), float(v)), True) for v, u in np.argwhere(mask)]
    assert min(inside, default=0) > -1e-3
    if line["fraction_visible"] == 1:
        assert mask.sum() == pytest.approx(cv2.contourArea(hull), rel=0.1)


def test_bop_by_object_and_part(folder, lines):
    infos = json.loads((folder / "bop/models/models_info.json").read_text())
    models = {
        int(id_): (info["name"], trimesh.load(folder / f"bop/models/obj_{int(id_):06d}.ply"))
        for id_, info in infos.items()
    }
    parts = json.loads((folder / "partition/partition.json").read_text())["parts"]
    for name, part in (("train", "train"), ("val", "valid"), ("test", "test")):
        scene = folder / f"bop/{name}/000000"
        poses, cameras, marks = (
            json.loads((scene / f"{file}.json").read_text())
            for file in ("scene_gt", "scene_camera", "scene_gt_info")
        )
        assert [int(id_) for id_ in poses] == parts[part]
        assert poses.keys() == cameras.keys() == marks.keys()
        for id_, (pose,) in poses.items():
            line = lines[int(id_)]
            craft, model = models[pose["obj_id"]]
            assert craft == line["spacecraft"]
            x_mm = model.vertices @ np.reshape(pose["cam_R_m2c"], (3, 3)).T + pose["cam_t_m2c"]
            assert_covers(folder, line, x_mm @ np.reshape(cameras[id_]["cam_K"], (3, 3)).T)
            steps = cv2.imread(str(scene / f"depth/{int(id_):06d}.png"), cv2.IMREAD_UNCHANGED)
            with np.load(folder / line["truth"]) as truth:
                depth_mm = np.nan_to_num(truth["depth_m"]) * 1e3
            scale = cameras[id_]["depth_scale"]
            assert np.abs(steps * scale - depth_mm).max() <= 0.51 * scale


def test_yolo_rows_are_of_one_length_and_name_their_craft(folder, lines):
    data = yaml.safe_load((folder / "yolo/data.yaml").read_text())
    count, numbers = data["kpt_shape"]
    assert (count, numbers) == (8, 3)
    for line in lines:
        text = (folder / f"yolo/labels/{line['index']:06d}.txt").read_text()
        rows = [[float(x) for x in row.split()] for row in text.splitlines()]
        assert bool(rows) == bool(line["box_visible_px"])
        for row in rows:
            assert len(row) == 5 + count * numbers
            assert data["names"][int(row[0])] == line["spacecraft"]
            points = np.reshape(row[5:], (-1, 3))
            names = data["kpt_names"][int(row[0])]
            assert not points[len(names) :].any()
            for name, (x, y, v) in zip(names, points, strict=False):
                u_px, v_px, visibility = line["keypoints"][name]
                assert v == visibility
                assert not v or (160 * x - 0.5, 120 * y - 0.5) == pytest.approx((u_px, v_px))


def test_yolo_lists_are_the_parts(folder):
    parts = json.loads((folder / "partition/partition.json").read_text())["parts"]
    for part, indices in parts.items():
        names = (folder / f"yolo/{part}.txt").read_text().split()
        assert names == [f"./images/{index:06d}.png" for index in indices]


def test_the_thesis_list_names_the_craft_of_each_frame(folder, lines):
    header, *rows = (row.split(",") for row in (folder / "posse/dataset.csv").read_text().splitlines())
    for row, line in zip(rows, lines, strict=True):
        values = dict(zip(header, row, strict=True))
        assert values["spacecraft"] == line["spacecraft"]
        q = [float(values[f"q_body_from_cam_{axis}"]) for axis in "xyzw"]
        camera = [float(values[f"camera_body_{axis}_m"]) for axis in "xyz"]
        body = Rotation.from_quat(q).apply(line["t_body_cam_m"])
        assert body == pytest.approx(-np.array(camera))
