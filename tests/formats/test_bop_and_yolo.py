"""BOP and YOLO-pose, read as their documents say, against the labels' closed forms."""

import json
import shutil
import struct

import cuboid
import cv2
import numpy as np
import pytest
import trimesh
import yaml

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._formats.bop import BopWriter
from posse_core._formats.yolo import YoloWriter
from posse_core._plugins.options import NoOptions
from posse_core._selection.partition import write_partition

TWO = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("two") / "d", TWO)
    BopWriter(NoOptions()).write(Dataset(folder), folder)
    YoloWriter(NoOptions()).write(Dataset(folder), folder)
    return folder


@pytest.fixture(scope="module")
def scene(folder):
    path = folder / "bop/train/000000"
    names = ("scene_camera", "scene_gt", "scene_gt_info")
    records = [json.loads((path / f"{name}.json").read_text()) for name in names]
    return path, [{int(k): v for k, v in record.items()} for record in records]


def test_bop_poses_project_the_model_onto_the_mask(folder, scene):
    path, (cameras, poses, infos) = scene
    assert sorted(poses) == sorted(cameras) == sorted(infos) == list(range(12))
    for index, (pose,) in poses.items():
        model = trimesh.load(folder / f"bop/models/obj_{pose['obj_id']:06d}.ply", process=False)
        R, t = np.reshape(pose["cam_R_m2c"], (3, 3)), np.array(pose["cam_t_m2c"])
        K = np.reshape(cameras[index]["cam_K"], (3, 3))
        uv = (model.vertices @ R.T + t) @ K.T
        uv = uv[:, :2] / uv[:, 2:]
        mask = cv2.imread(str(path / f"mask/{index:06d}_000000.png"), cv2.IMREAD_UNCHANGED) == 255
        visible = (
            cv2.imread(str(path / f"mask_visib/{index:06d}_000000.png"), cv2.IMREAD_UNCHANGED) == 255
        )
        assert np.array_equal(mask, visible)
        # The outline of a convex body is its corners' hull.
        hull = cv2.convexHull(uv.astype(np.float32))
        v, u = np.nonzero(mask)
        inside = [
            cv2.pointPolygonTest(hull, (float(a), float(b)), True) for a, b in zip(u, v, strict=True)
        ]
        assert min(inside, default=0) > -1e-3
        (info,) = infos[index]
        assert info["px_count_visib"] == mask.sum()
        if mask.any():
            x, y, width, height = info["bbox_visib"]
            assert (x, y, x + width, y + height) == (u.min(), v.min(), u.max(), v.max())
        else:
            assert info["bbox_visib"] == [-1, -1, -1, -1]
        ends_inside = mask.any() and not (mask[[0, -1]].any() or mask[:, [0, -1]].any())
        if ends_inside:
            assert info["bbox_obj"] == info["bbox_visib"]
        else:
            low, high = np.ceil(uv.min(axis=0)), np.floor(uv.max(axis=0))
            assert info["bbox_obj"] == [*low, *(high - low)]


def test_bop_depth_times_its_scale_is_millimetres(folder, scene):
    path, (cameras, _, _) = scene
    for index in range(12):
        steps = cv2.imread(str(path / f"depth/{index:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert steps.dtype == np.uint16
        truth_mm = np.load(folder / f"truth/{index:06d}.npz")["depth_m"] * 1e3
        assert np.array_equal(steps == 0, np.isnan(truth_mm))
        scale = cameras[index]["depth_scale"]
        error = np.abs(steps * scale - truth_mm)[steps > 0]
        assert np.all(error <= 0.51 * scale)
        assert scale < 0.6  # a craft at 30 m; a step of 1 mm would end at 65 m


def test_bop_models_have_their_size_diameter_and_symmetries(folder):
    infos = json.loads((folder / "bop/models/models_info.json").read_text())
    for id_, (name, half) in enumerate(TWO, 1):
        info = infos[str(id_)]
        assert info["name"] == name
        assert [info[f"min_{axis}"] for axis in "xyz"] == pytest.approx(list(-1e3 * half))
        assert [info[f"size_{axis}"] for axis in "xyz"] == pytest.approx(list(2e3 * half))
        assert info["diameter"] == pytest.approx(2e3 * np.linalg.norm(half))
        (symmetry,) = info["symmetries_discrete"]
        assert np.array_equal(np.reshape(symmetry, (4, 4)), np.diag([1, -1, -1, 1]))


def test_bop_model_is_laid_as_the_toolkit_reads_it(folder):
    """Byte by byte: its reader knows float and int, and lists of three alone."""
    data = (folder / "bop/models/obj_000001.ply").read_bytes()
    header, _, body = data.partition(b"end_header\n")
    lines = header.decode().splitlines()
    assert [line for line in lines if line.startswith("property")] == [
        "property float x",
        "property float y",
        "property float z",
        "property list uchar int vertex_indices",
    ]
    assert "element vertex 24" in lines
    assert "element face 12" in lines
    assert struct.unpack_from("<3f", body) == pytest.approx((-1500.0, -800.0, -500.0))
    assert struct.unpack_from("<B", body, 24 * 12) == (3,)
    assert len(body) == 24 * 12 + 12 * 13


def test_bop_images_are_the_dataset_s(folder, scene):
    path, _ = scene
    for index in range(12):
        name = f"{index:06d}.png"
        assert (path / "gray" / name).read_bytes() == (folder / "images" / name).read_bytes()


def test_bop_parts_are_those_of_the_partition(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    dataset = Dataset(tmp_path / "d")
    parts = write_partition(dataset, (2, 2, 2), 0, "frame")
    BopWriter(NoOptions()).write(dataset, tmp_path)
    for name, part in (("train", "train"), ("val", "valid"), ("test", "test")):
        poses = json.loads((tmp_path / f"bop/{name}/000000/scene_gt.json").read_text())
        assert [int(index) for index in poses] == parts[part]


def test_bop_without_depth_says_so(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    lines = [{**line, "truth": None} for line in cuboid.read_lines(dataset_folder)]
    cuboid.write_lines(tmp_path / "d", lines)
    with pytest.raises(InputError, match="add 'depth' to the scenario"):
        BopWriter(NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)


def yolo_rows(folder, index):
    text = (folder / f"yolo/labels/{index:06d}.txt").read_text()
    return [[float(x) for x in row.split()] for row in text.splitlines()]


def test_yolo_boxes_and_keypoints_in_pixels_are_the_labels(folder):
    lines = cuboid.read_lines(folder)
    for line in lines:
        rows = yolo_rows(folder, line["index"])
        if line["box_visible_px"] is None:
            assert rows == []
            continue
        ((class_, cx, cy, width, height, *points),) = rows
        assert class_ == (line["spacecraft"] == "plate")
        assert all(0 <= x <= 1 for x in (cx, cy, width, height))
        x, y = cx * 160 - width * 160 / 2, cy * 120 - height * 120 / 2
        assert [x, y, width * 160, height * 120] == pytest.approx(line["box_visible_px"])
        for (px, py, v), (u_px, v_px, visibility) in zip(
            np.reshape(points, (8, 3)), line["keypoints"].values(), strict=True
        ):
            assert v == visibility
            if visibility == 0:
                assert (px, py) == (0, 0)
            else:
                assert (px * 160 - 0.5, py * 120 - 0.5) == pytest.approx((u_px, v_px))


def test_yolo_data_file(folder):
    data = yaml.safe_load((folder / "yolo/data.yaml").read_text())
    assert data["names"] == {0: "brick", 1: "plate"}
    assert data["kpt_shape"] == [8, 3]
    assert data["flip_idx"] == list(range(8))
    assert "fliplr=0" in (folder / "yolo/data.yaml").read_text()
    for part in ("train", "val", "test"):
        for name in (folder / "yolo" / data[part]).read_text().split():
            image = folder / "yolo" / name
            assert image.is_file()
            assert (
                folder / "yolo" / name.replace("/images/", "/labels/").replace(".png", ".txt")
            ).is_file()


def test_yolo_lists_are_those_of_the_partition(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    dataset = Dataset(tmp_path / "d")
    parts = write_partition(dataset, (4, 1, 1), 0, "frame")
    YoloWriter(NoOptions()).write(dataset, tmp_path)
    for part, indices in parts.items():
        names = (tmp_path / f"yolo/{part}.txt").read_text().split()
        assert names == [f"./images/{index:06d}.png" for index in indices]
    assert "Not divided" not in (tmp_path / "yolo/data.yaml").read_text()


def test_yolo_of_a_craft_without_keypoints_says_so(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    path = tmp_path / "d/spacecraft/brick.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "keypoints": {}}))
    with pytest.raises(InputError, match="no spacecraft has keypoints"):
        YoloWriter(NoOptions()).write(Dataset(tmp_path / "d"), tmp_path)
    assert not (tmp_path / "yolo").exists()


def test_exports_can_be_made_again_and_leave_the_dataset_alone(dataset_folder, tmp_path):
    shutil.copytree(dataset_folder, tmp_path / "d")
    dataset = Dataset(tmp_path / "d")
    for writer in (YoloWriter(NoOptions()), BopWriter(NoOptions())) * 2:
        writer.write(dataset, tmp_path / "d")
    image = cv2.imread(str(tmp_path / "d/yolo/images/000003.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(image, dataset.image(3))
    assert not list((tmp_path / "d/yolo").rglob(".*"))
