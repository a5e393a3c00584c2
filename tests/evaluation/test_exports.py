"""Exports read back are the labels; each fault planted in one is found, and told from the others'."""

import json
import shutil

import cuboid
import cv2
import numpy as np
import pytest

from posse_core._dataset.coco import read_coco
from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.validate import validate
from posse_core._formats.bop import BopWriter, read_bop
from posse_core._formats.coco import CocoWriter
from posse_core._formats.colmap import ColmapWriter
from posse_core._formats.hf import HfOptions, HfWriter
from posse_core._formats.nerfstudio import NerfstudioWriter
from posse_core._formats.speed import SpeedWriter, read_speed
from posse_core._formats.yolo import YoloWriter, read_yolo
from posse_core._plugins.options import NoOptions

FRAME = 3
IMAGE = "images/000003.png"
NAMES = ("bop", "coco", "colmap", "nerfstudio", "speed", "yolo")
WRITERS = (BopWriter, CocoWriter, ColmapWriter, NerfstudioWriter, SpeedWriter, YoloWriter)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    crafts = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("exports") / "d", crafts)
    for writer in WRITERS:
        writer(NoOptions()).write(Dataset(folder), folder)
    return folder


@pytest.fixture
def folder(exported, tmp_path):
    shutil.copytree(exported, tmp_path / "d")
    return tmp_path / "d"


def results(folder):
    report = validate(Dataset(folder), lambda places, frames: places)
    return {result.name: result for result in report.results}


def assert_found(folder, export, words, frame=FRAME):
    found = results(folder)
    faults = found.pop(f"{export} export").faults
    assert [(fault.frame, words in fault.message) for fault in faults] == [(frame, True)], faults
    assert not any(result.faults for result in found.values())


def test_clean_exports_pass(exported):
    found = results(exported)
    exports = {name: result.checked for name, result in found.items() if name.endswith("export")}
    assert exports == {f"{name} export": 12 for name in NAMES}
    assert not any(result.faults for result in found.values())


# Out, in, the same labels


def shown(line):
    """Keypoints in the image, or None where the craft is not seen."""
    points = {name: point for name, point in line["keypoints"].items() if point[2] > 0}
    return points if line["box_visible_px"] else None


def test_coco_and_speed_come_back_to_the_bit(exported):
    lines = {line["image"]: line for line in cuboid.read_lines(exported)}
    back = [json.loads(labels.to_json()) for labels in read_coco(exported / "coco.json")]
    assert [labels["image"] for labels in back] == list(lines)
    for labels in back:
        line = lines[labels["image"]]
        assert labels.get("keypoints") == shown(line)
        assert all(line[k] == v for k, v in labels.items() if k != "keypoints")
    for pose in read_speed(exported / "speed.json"):
        assert list(pose.q_cam_from_body) == lines[pose.image]["q_cam_from_body"]
        assert list(pose.t_body_cam_m) == lines[pose.image]["t_body_cam_m"]


def test_the_older_key_of_speed_is_read(tmp_path):
    entry = {"filename": "a.jpg", "q_vbs2tango": [1, 0, 0, 0], "r_Vo2To_vbs_true": [0, 0, 9]}
    (tmp_path / "train.json").write_text(json.dumps([entry]))
    (back,) = read_speed(tmp_path / "train.json")
    assert back == ("a.jpg", (1, 0, 0, 0), (0, 0, 9))


def test_yolo_comes_back_within_rounding(exported):
    lines = {line["image"]: line for line in cuboid.read_lines(exported)}
    back = {each.image: each.bodies for each in read_yolo(exported / "yolo", cuboid.CAMERA)}
    assert back.keys() == lines.keys()
    for name, bodies in back.items():
        line, points = lines[name], shown(lines[name])
        if points is None:
            assert bodies == []
            continue
        labels = bodies[0].labels
        assert labels.spacecraft == line["spacecraft"]
        assert labels.box_visible_px == pytest.approx(line["box_visible_px"], abs=1e-10)
        assert labels.keypoints.keys() == points.keys()
        assert all(labels.keypoints[k] == pytest.approx(points[k], abs=1e-10) for k in points)


def test_bop_comes_back_within_its_depth_step(exported):
    lines = {line["image"]: line for line in cuboid.read_lines(exported)}
    back = list(read_bop(exported / "bop"))
    assert [each.image for each in back] == list(lines)
    for each in back:
        line, (body,) = lines[each.image], each.bodies
        labels = body.labels
        assert labels.spacecraft == line["spacecraft"]
        assert labels.q_cam_from_body == pytest.approx(line["q_cam_from_body"], abs=1e-12)
        assert labels.t_body_cam_m == pytest.approx(line["t_body_cam_m"], abs=1e-12)
        with np.load(exported / line["truth"]) as truth:
            assert np.array_equal(body.mask, truth["part_id"] >= 0)
            off = np.abs(each.depth_m - truth["depth_m"])
            assert np.array_equal(np.isnan(off), np.isnan(truth["depth_m"]))
            assert not np.any(off > 0.51 * each.depth_step_m)


# Planted faults


def alter_json(path, alter):
    value = json.loads(path.read_text())
    alter(value)
    path.write_text(json.dumps(value))


def test_speed_scalar_last(folder):
    def alter(poses):
        w, x, y, z = poses[FRAME]["q_vbs2tango_true"]
        poses[FRAME]["q_vbs2tango_true"] = [x, y, z, w]

    alter_json(folder / "speed.json", alter)
    assert_found(folder, "speed", "q_cam_from_body is not that of the label line: it is scalar-last")


def test_speed_inverse_rotation(folder):
    def alter(poses):
        w, x, y, z = poses[FRAME]["q_vbs2tango_true"]
        poses[FRAME]["q_vbs2tango_true"] = [-w, x, y, z]

    alter_json(folder / "speed.json", alter)
    assert_found(folder, "speed", "it is the inverse")


def test_speed_without_a_frame(folder):
    alter_json(folder / "speed.json", lambda poses: poses.pop(FRAME))
    assert_found(folder, "speed", "is not in it")


def test_speed_with_a_frame_twice(folder):
    alter_json(folder / "speed.json", lambda poses: poses.append(poses[FRAME]))
    assert_found(folder, "speed", "images/000003.png: is in it twice", frame=None)


def annotation(value):
    return next(each for each in value["annotations"] if each["image_id"] == FRAME)


def test_coco_box_by_corners(folder):
    def alter(value):
        x, y, width, height = annotation(value)["bbox"]
        annotation(value)["bbox"] = [x, y, x + width, y + height]

    alter_json(folder / "coco.json", alter)
    assert_found(folder, "coco", "box_visible_px")


def test_coco_keypoints_half_a_pixel_off(folder):
    def alter(value):
        points = annotation(value)["keypoints"]
        points[0::3] = [u + 0.5 for u in points[0::3]]

    alter_json(folder / "coco.json", alter)
    assert_found(folder, "coco", "keypoints")


def test_coco_category_of_the_other_craft(folder):
    alter_json(folder / "coco.json", lambda value: annotation(value).update(category_id=2))
    assert_found(folder, "coco", "spacecraft")


def test_coco_of_an_image_that_is_not_there(folder):
    image = {"id": 99, "file_name": "images/000099.png", "width": 160, "height": 120}
    alter_json(folder / "coco.json", lambda value: value["images"].append(image))
    assert_found(folder, "coco", "no frame has this image", frame=None)


def test_coco_cut_short(folder):
    path = folder / "coco.json"
    path.write_text(path.read_text()[:-100])
    assert_found(folder, "coco", "not valid COCO: invalid JSON", frame=None)


def test_yolo_keypoints_without_the_half_pixel(folder):
    path = folder / "yolo/labels/000003.txt"
    row = [float(x) for x in path.read_text().split()]
    row[5::3] = [x - 0.5 / 160 for x in row[5::3]]
    path.write_text(" ".join(map(str, [0, *row[1:]])))
    assert_found(folder, "yolo", "keypoints")


def test_yolo_of_a_seen_craft_emptied(folder):
    (folder / "yolo/labels/000003.txt").write_text("")
    assert_found(folder, "yolo", "it has 0 bodies of this image, the label line has 1")


def test_bop_position_in_metres(folder):
    def alter(value):
        value[str(FRAME)][0]["cam_t_m2c"] = [x / 1e3 for x in value[str(FRAME)][0]["cam_t_m2c"]]

    alter_json(folder / "bop/train/000000/scene_gt.json", alter)
    assert_found(folder, "bop", "t_body_cam_m")


def test_bop_wrong_depth_scale(folder):
    def alter(value):
        value[str(FRAME)]["depth_scale"] *= 1.001

    alter_json(folder / "bop/train/000000/scene_camera.json", alter)
    assert_found(folder, "bop", "depth is not the dataset's")


def test_bop_mask_of_another_frame(folder):
    scene = folder / "bop/train/000000/mask_visib"
    shutil.copy(scene / "000001_000000.png", scene / "000003_000000.png")
    assert_found(folder, "bop", "mask is not the dataset's")


def test_bop_depth_of_eight_bits(folder):
    path = folder / "bop/train/000000/depth/000003.png"
    steps = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(path), (steps // 256).astype(np.uint8))
    assert_found(folder, "bop", "depth is not the dataset's")


IMAGES = "colmap/brick/sparse/0/images.txt"


def alter_row(path, number, alter):
    """Alter the words of a line of a text file."""
    lines = path.read_text().splitlines(keepends=True)
    lines[number] = " ".join(alter(lines[number].split())) + "\n"
    path.write_text("".join(lines))


def test_colmap_quaternion_scalar_last(folder):
    alter_row(folder / IMAGES, 2 * FRAME + 1, lambda words: [])  # its points would tell, too
    alter_row(folder / IMAGES, 2 * FRAME, lambda words: [words[0], *words[2:5], words[1], *words[5:]])
    assert_found(folder, "colmap", "it is scalar-last")


def test_colmap_points_without_the_half_pixel(folder):
    def shifted(words):
        return [str(float(x) - 0.5) if i % 3 < 2 else x for i, x in enumerate(words)]

    alter_row(folder / IMAGES, 2 * FRAME + 1, shifted)
    assert_found(folder, "colmap", "a point of 000003.png is 0.707 px from its projection", frame=None)


def test_colmap_camera_without_the_half_pixel(folder):
    path = folder / "colmap/plate/sparse/0/cameras.txt"
    path.write_text(path.read_text().replace("80.0 60.0", "79.5 59.5"))
    assert_found(folder, "colmap", "is not the dataset's camera", frame=None)


def test_colmap_mask_of_another_frame(folder):
    masks = folder / "colmap/brick/masks"
    shutil.copy(masks / "000002.png.png", masks / "000003.png.png")
    assert_found(folder, "colmap", "mask is not the dataset's")


def test_colmap_without_an_image(folder):
    path = folder / IMAGES
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: 2 * FRAME] + lines[2 * FRAME + 2 :]))
    assert_found(folder, "colmap", "is not in it")


def test_nerfstudio_pose_in_axes_of_opencv(folder):
    def alter(value):
        pose = np.array(value["frames"][FRAME]["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        value["frames"][FRAME]["transform_matrix"] = pose.tolist()

    alter_json(folder / "nerfstudio/brick/transforms.json", alter)
    found = results(folder)["nerfstudio export"].faults
    assert {fault.frame for fault in found} == {FRAME}
    assert {fault.message.split()[0] for fault in found} == {"q_cam_from_body", "t_body_cam_m"}


def test_nerfstudio_camera_without_the_half_pixel(folder):
    alter_json(folder / "nerfstudio/brick/transforms.json", lambda value: value.update(cx=79.5))
    assert_found(folder, "nerfstudio", "cx is 79.5, the dataset's camera has 80.0", frame=None)


@pytest.fixture
def with_hf(folder):
    """Written by the export for Hugging Face alone, with options of its own."""
    options = HfOptions(licence="cc-by-4.0", published="2027-03-31", citation="@misc{bricks}")
    HfWriter(options).write(Dataset(folder), folder)
    return folder


def assert_hf(folder, *messages):
    found = results(folder)
    result = found.pop("hf files")
    assert [fault.message for fault in result.faults] == list(messages)
    assert not any(other.faults for other in found.values())
    return result


def test_hf_passes_with_the_options_that_it_was_written_with(with_hf):
    # images, their list, Croissant, the camera, and mesh and keypoints of two crafts
    assert assert_hf(with_hf).checked == 12 + 1 + 1 + 1 + 4


def test_hf_keypoint_of_another_place(with_hf):
    path = with_hf / "hf/train/metadata.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines[FRAME]["keypoints"][2]["u_px"] += 0.5
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert_hf(with_hf, f"hf/train/metadata.jsonl: line {FRAME + 1} is not that of the labels")


def test_hf_image_of_another_frame(with_hf):
    images = with_hf / "hf/train"
    (images / "000003.png").unlink()
    shutil.copy(images / "000004.png", images / "000003.png")
    assert_hf(with_hf, "hf/train/000003.png: it is another image")


def test_hf_column_of_another_type(with_hf):
    def alter(value):
        fields = value["recordSet"][0]["field"]
        next(field for field in fields if field["name"] == "index")["dataType"] = "sc:Text"

    alter_json(with_hf / "hf/croissant.json", alter)
    (fault,) = results(with_hf)["hf files"].faults
    assert "hf/croissant.json: recordSet.0.field.2.dataType is sc:Text" in fault.message


def test_hf_with_a_licence_that_it_cannot_have_been_written_with(with_hf):
    alter_json(with_hf / "hf/croissant.json", lambda value: value.update(license="All rights!"))
    (fault,) = results(with_hf)["hf files"].faults
    assert "licence" in fault.message
