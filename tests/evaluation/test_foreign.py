"""Labels that come without a dataset: ours, carried away, pass; planted faults are found."""

import json
import shutil

import cuboid
import numpy as np
import pytest
from click.testing import CliRunner

from posse_core._cli.validate import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.foreign import validate_foreign
from posse_core._formats.bop import BopWriter
from posse_core._formats.coco import CocoWriter
from posse_core._formats.speed import SpeedWriter
from posse_core._formats.yolo import YoloWriter
from posse_core._plugins.options import NoOptions

FRAME = 3


@pytest.fixture
def away(dataset_folder, tmp_path):
    """Exports in a folder that has images and camera.json, and nothing else of the dataset."""
    for writer in (BopWriter, CocoWriter, SpeedWriter, YoloWriter):
        writer(NoOptions()).write(Dataset(dataset_folder), tmp_path)
    shutil.copytree(dataset_folder / "images", tmp_path / "images")
    shutil.copy(dataset_folder / "camera.json", tmp_path)
    return tmp_path


def faults(path):
    report = validate_foreign(path)
    return {
        (result.name, fault.frame, fault.message) for result in report.results for fault in result.faults
    }


def assert_found(path, check, words, frame=FRAME):
    ((name, its_frame, message),) = faults(path)
    assert (name, its_frame) == (check, frame)
    assert words in message


def alter(path, change):
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def annotation(value):
    return next(each for each in value["annotations"] if each["image_id"] == FRAME)


@pytest.mark.parametrize("name", ["coco.json", "speed.json", "bop", "yolo"])
def test_clean_labels_pass(away, name):
    assert faults(away / name) == set()
    result = CliRunner().invoke(command, [str(away / name)])
    assert result.exit_code == 0, result.exception


def test_coco_box_by_corners(away):
    def change(value):
        x, y, width, height = annotation(value)["bbox"]
        annotation(value)["bbox"] = [x, y, x + width, y + height]

    alter(away / "coco.json", change)
    assert ("boxes", FRAME) in checks(away / "coco.json")


def test_coco_box_in_shares_of_the_image(away):
    alter(away / "coco.json", lambda value: annotation(value).update(bbox=[0.3, 0.2, 0.1, 0.1]))
    assert_found(away / "coco.json", "boxes", "the mask's")


def test_coco_box_beyond_the_image(away):
    def change(value):
        annotation(value)["bbox"][0] += 150
        del annotation(value)["segmentation"]

    alter(away / "coco.json", change)
    assert_found(away / "coco.json", "boxes", "leaves the image")


def test_coco_area_of_the_box(away):
    alter(away / "coco.json", lambda value: annotation(value).update(area=10_000))
    assert_found(away / "coco.json", "boxes", "the area is 10000")


def test_coco_count_of_keypoints(away):
    alter(away / "coco.json", lambda value: annotation(value).update(num_keypoints=1))
    assert_found(away / "coco.json", "keypoints", "num_keypoints is 1")


def test_coco_keypoints_of_another_category(away):
    alter(away / "coco.json", lambda value: annotation(value)["keypoints"].extend([1, 2, 2]))
    assert_found(away / "coco.json", "keypoints", "not three a keypoint")


def test_coco_annotation_id_0(away):
    """pycocotools takes id 0 for 'no match'."""
    alter(away / "coco.json", lambda value: annotation(value).update(id=0))
    assert_found(away / "coco.json", "ids", "annotation id 0 is 0")


def test_coco_annotation_of_no_image(away):
    alter(away / "coco.json", lambda value: annotation(value).update(image_id=77))
    assert_found(away / "coco.json", "ids", "of no image", frame=77)


def test_coco_image_missing(away):
    (away / "images/000003.png").unlink()
    assert_found(away / "coco.json", "files", "missing")


def test_speed_quaternion_not_of_unit_length(away):
    alter(away / "speed.json", lambda value: value[FRAME].update(q_vbs2tango_true=[1, 1, 0, 0]))
    assert_found(away / "speed.json", "pose", "not of length 1")


def test_speed_target_behind_the_camera(away):
    """The camera's z axis backward, as OpenGL has it."""
    alter(away / "speed.json", lambda value: value[FRAME]["r_Vo2To_vbs_true"].__setitem__(2, -8.0))
    assert_found(away / "speed.json", "pose", "not before the camera")


def test_speed_target_far_aside(away):
    alter(away / "speed.json", lambda value: value[FRAME].update(r_Vo2To_vbs_true=[60.0, 0.0, 9.0]))
    assert_found(away / "speed.json", "aim", "far outside the image")


def test_speed_image_listed_twice(away):
    alter(away / "speed.json", lambda value: value.append(value[FRAME]))
    assert_found(away / "speed.json", "ids", "listed twice", frame=6)


def bop_pose(away, change):
    alter(away / "bop/train/000000/scene_gt.json", lambda value: change(value[str(FRAME)][0]))


def checks(path):
    return {(check, frame) for check, frame, _ in faults(path)}


def test_bop_rotation_transposed(away):
    def change(pose):
        pose["cam_R_m2c"] = np.reshape(pose["cam_R_m2c"], (3, 3)).T.ravel().tolist()

    bop_pose(away, change)
    assert ("mask", FRAME) in checks(away / "bop")
    assert {frame for _, frame in checks(away / "bop")} == {FRAME}


def test_bop_rotation_mirrored(away):
    def change(pose):
        pose["cam_R_m2c"] = (-np.reshape(pose["cam_R_m2c"], (3, 3))).ravel().tolist()

    bop_pose(away, change)
    assert_found(away / "bop", "pose", "is no rotation")


def test_bop_position_in_metres(away):
    bop_pose(away, lambda pose: pose.update(cam_t_m2c=[x / 1e3 for x in pose["cam_t_m2c"]]))
    assert ("mask", FRAME) in checks(away / "bop")


def test_bop_depth_scale_for_metres(away):
    def change(value):
        value[str(FRAME)]["depth_scale"] /= 1e3

    alter(away / "bop/train/000000/scene_camera.json", change)
    assert_found(away / "bop", "depth", "mm from the model")


def test_bop_mask_of_another_image(away):
    scene = away / "bop/train/000000/mask_visib"
    shutil.copy(scene / "000001_000000.png", scene / "000003_000000.png")
    assert ("mask", FRAME) in checks(away / "bop")


def alter_row(away, change):
    path = away / "yolo/labels/000003.txt"
    row = [float(x) for x in path.read_text().split()]
    change(row)
    path.write_text(" ".join(map(repr, row)))


def test_yolo_row_with_a_keypoint_too_few(away):
    alter_row(away, lambda row: row.__delitem__(slice(-3, None)))
    assert_found(away / "yolo", "rows", "26 numbers")


def test_yolo_class_that_has_no_name(away):
    alter_row(away, lambda row: row.__setitem__(0, 1.0))
    assert_found(away / "yolo", "rows", "its class")


def test_yolo_box_by_its_corner(away):
    alter_row(away, lambda row: row.__setitem__(slice(1, 5), [0.0, 0.4, 0.2, 0.2]))
    assert_found(away / "yolo", "boxes", "leaves the image")


def test_yolo_keypoints_in_pixels(away):
    alter_row(away, lambda row: row.__setitem__(5, 80.0))
    assert_found(away / "yolo", "keypoints", "outside the image")


def test_yolo_image_without_a_text(away):
    (away / "yolo/labels/000003.txt").unlink()
    assert_found(away / "yolo", "files", "000003.txt: missing")


def test_yolo_image_in_two_parts(away):
    (away / "yolo/valid.txt").write_text("./images/000003.png\n")
    (away / "yolo/test.txt").write_text("")
    assert_found(away / "yolo", "partition", "000003.png: is in two parts")


@pytest.mark.parametrize("layout", ["folders", "lists"])
def test_yolo_as_ultralytics_lays_it(away, layout):
    """Parts by folder, names as a list, keypoints without a visibility."""
    other = away / "other"
    for kind, suffix in (("images", "png"), ("labels", "txt")):
        for part, frames in (("train", (0, 1)), ("val", (3,))):
            (other / kind / part).mkdir(parents=True)
            for i in frames:
                shutil.copy(away / f"yolo/{kind}/{i:06d}.{suffix}", other / kind / part)
    for path in other.glob("labels/*/*.txt"):
        row = path.read_text().split()
        path.write_text(" ".join([*row[:5], *(x for i, x in enumerate(row[5:]) if i % 3 < 2)]))
    parts = "train: images/train\nval: images/val\n"
    if layout == "lists":
        (other / "train.txt").write_text(f"{other}/images/train/000000.png\n./images/train/000001.png\n")
        parts = "train: train.txt\nval: images/val\n"
    (other / "data.yaml").write_text(f"path: .\n{parts}names: [brick]\nkpt_shape: [8, 2]\n")
    report = validate_foreign(other)
    assert report.passed
    assert [(result.name, result.checked) for result in report.results] == [
        ("files", 3),
        ("rows", 3),
        ("boxes", 3),
        ("keypoints", 3),
        ("partition", 3),
    ]


def test_yolo_list_that_is_missing(away):
    (away / "yolo/train.txt").unlink()
    with pytest.raises(InputError, match=r"train\.txt: cannot be read: there is no such file"):
        validate_foreign(away / "yolo")


def damaged(file, change):
    return lambda away: alter(away / file, change)


def written(file, change):
    return lambda away: (away / file).write_bytes(change((away / file).read_bytes()))


@pytest.mark.parametrize(
    ("name", "spoil", "words"),
    [
        (
            "coco.json",
            damaged("coco.json", lambda value: annotation(value).pop("bbox")),
            r"coco\.json: not a COCO file: annotations\.\d+\.bbox: missing",
        ),
        (
            "coco.json",
            damaged("coco.json", lambda value: annotation(value).update(bbox=[[], 1, 2, 3])),
            r"annotations\.\d+\.bbox\.0.*number",
        ),
        (
            "speed.json",
            damaged("speed.json", lambda value: value[2].update(r_Vo2To_vbs_true=[[1], 2, 3])),
            r"not a file of SPEED: 2\.r_Vo2To_vbs_true\.0",
        ),
        (
            "bop",
            damaged("bop/train/000000/scene_gt.json", lambda value: value["3"][0].pop("cam_t_m2c")),
            r"scene_gt\.json: not poses of BOP: 3\.0\.cam_t_m2c: missing",
        ),
        (
            "bop",
            damaged(
                "bop/train/000000/scene_gt.json", lambda value: value["3"][0].update(cam_R_m2c=[1.0] * 8)
            ),
            r"scene_gt\.json.*cam_R_m2c.*at least 9",
        ),
        (
            "bop",
            damaged("bop/train/000000/scene_camera.json", lambda value: value.update(x={})),
            r"scene_camera\.json.*x",
        ),
        (
            "bop",
            written("bop/models/obj_000001.ply", lambda data: data[:-40]),
            r"obj_000001\.ply: cannot be read as PLY",
        ),
        (
            "bop",
            written(
                "bop/models/obj_000001.ply", lambda data: data[:-8] + b"\xff\xff\xff\x7f" + data[-4:]
            ),
            r"obj_000001\.ply: triangles refer to vertices that do not exist",
        ),
        (
            "yolo",
            written("yolo/data.yaml", lambda data: data.replace(b"kpt_shape: [", b"kpt_shape: [x, ")),
            r"data\.yaml, line \d+: kpt_shape",
        ),
        ("yolo", written("yolo/data.yaml", lambda data: b"- 1\n"), "a mapping of keys"),
    ],
)
def test_what_a_format_does_not_have_is_told_by_file_and_key(away, name, spoil, words):
    spoil(away)
    with pytest.raises(InputError, match=words) as told:
        validate_foreign(away / name)
    assert "Error" not in str(told.value)


def test_yolo_row_of_words_is_a_fault_of_its_image(away):
    (text,) = (away / "yolo/labels").rglob("000003.txt")
    text.write_text(text.read_text().replace(" 0.", " seed", 1))
    assert_found(away / "yolo", "rows", "000003.txt")


def test_bop_image_without_a_camera(away):
    (path,) = (away / "bop").rglob("scene_camera.json")
    alter(path, lambda value: value.pop("3"))
    assert_found(away / "bop", "pose", "no camera")


def test_what_is_no_label_file(away):
    for text, words in (("{", "not JSON"), ("[]", "neither"), ("{}", "neither")):
        (away / "x.json").write_text(text)
        with pytest.raises(InputError, match=words):
            validate_foreign(away / "x.json")
    assert validate_foreign(away / "none") is None


def test_a_dataset_of_ours_is_none_of_these(dataset_folder):
    assert validate_foreign(dataset_folder) is None
    assert cuboid.read_lines(dataset_folder)
