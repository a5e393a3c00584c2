"""A table of faults: each is planted in a rendered dataset, as by a program that is wrong, and found."""

import contextlib
import copy
import shutil
from pathlib import Path

import cv2
import numpy as np
import planting as p
import pytest

import posse_core as posse
from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.result import Report
from posse_core._evaluation.validate import validate

pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")

FRAME, COUNT = 1, 4
SCENARIO = {
    "camera.width_px": 240,
    "camera.height_px": 180,
    "camera.hfov_deg": 50,
    "times": {"t_s": [3750.0, 3950.0, 4200.0, 4450.0]},
    "annotators": ["box", "mask", "parts", "depth", "normals", "keypoints", "pose"],
    "writers": ["coco", "speed", "posse", "yolo", "bop"],
}
SCENE = "bop/train/000000"


def annotation(value, index=FRAME):
    return next(each for each in value["annotations"] if each["image_id"] == index)


def shifted(u, v):
    return lambda image: np.roll(image, (v, u), axis=(0, 1))


def flat(arrays):
    arrays["normal_cam"][np.isfinite(arrays["normal_cam"]).all(-1)] = [0, 0, -1]


def permuted(arrays):
    ids = arrays["part_id"]
    arrays["part_id"] = np.where(ids >= 0, (ids + 1) % (ids.max() + 1), ids).astype(ids.dtype)


def no_parts(arrays):
    arrays["part_id"][arrays["part_id"] >= 0] = 0


def without_a_triangle(folder):
    path = folder / "spacecraft/aqua.ply"
    header, mark, body = path.read_bytes().partition(b"end_header\n")
    count = int(header.split(b"element face ")[1].split()[0])
    one_face = (len(body) - vertex_bytes(header)) // count
    header = header.replace(b"element face %d" % count, b"element face %d" % (count - 1))
    path.write_bytes(header + mark + body[:-one_face])


def vertex_bytes(header):
    count = int(header.split(b"element vertex ")[1].split()[0])
    size = 8 if b"double x" in header or b"float64 x" in header else 4
    return 3 * size * count


def doubled(value):
    value["annotations"][1]["id"] = value["annotations"][0]["id"]


def size_swapped(value):
    for image in value["images"]:
        image["width"], image["height"] = image["height"], image["width"]


def conjugate(text):
    rows = text.splitlines()
    words = rows[FRAME + 1].split(",")
    words[-3:] = [str(-float(x)) for x in words[-3:]]
    rows[FRAME + 1] = ",".join(words)
    return "\n".join(rows) + "\n"


def scaled_model(folder):
    path = folder / "bop/models/obj_000001.ply"
    data = bytearray(path.read_bytes())
    start = data.index(b"end_header\n") + len(b"end_header\n")
    count = int(bytes(data[:start]).split(b"element vertex ")[1].split()[0])
    vertices = np.frombuffer(bytes(data[start : start + 12 * count]), "<f4") * np.float32(1.01)
    data[start : start + 12 * count] = vertices.astype("<f4").tobytes()
    path.write_bytes(bytes(data))


def halves_of_two(folder):
    """As a file that a second writer began to overwrite: the craft is in both halves."""
    other = cv2.imread(str(folder / "images/000002.png"), cv2.IMREAD_UNCHANGED)
    p.picture(FRAME, lambda x: np.vstack([x[:80], other[80:]]))(folder)


def enlarged(factor):
    def alter(image):
        height, width = image.shape[:2]
        to = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 0, factor)
        return cv2.warpAffine(image, to, (width, height))

    return alter


def first_rows_dropped(image):
    return cv2.resize(image[20:-20, 20:-20], image.shape[1::-1])


def set_in(*path):
    """Set ``path[-1]`` at the keys before it."""
    *keys, last, new = path

    def alter(value):
        for key in keys:
            value = value[key]
        value[last] = new(value[last]) if callable(new) else new

    return alter


def delete(*path):
    *keys, last = path

    def alter(value):
        for key in keys:
            value = value[key]
        del value[last]

    return alter


def exchanged(a, b, *keys):
    def alter(lines):
        for key in keys:
            lines[a][key], lines[b][key] = lines[b][key], lines[a][key]

    return alter


def negative(x):
    return [-value for value in x]


OF_THE_ISSUE = {
    "picture of the next frame": (p.other_picture(FRAME, 2), "the picture"),
    "picture mirrored": (p.picture(FRAME, lambda x: x[:, ::-1]), "the picture is mirrored in x"),
    "picture upside down": (p.picture(FRAME, lambda x: x[::-1]), "the picture is mirrored in y"),
    "picture turned by 180°": (p.picture(FRAME, lambda x: x[::-1, ::-1]), "is mirrored in x and y"),
    "picture shifted by 2 px": (p.picture(FRAME, shifted(2, 0)), "shifted by (2, 0) px"),
    "picture shifted by 10 px": (p.picture(FRAME, shifted(10, 0)), "the picture"),
    "picture black": (p.picture(FRAME, np.zeros_like), "the picture is black"),
    "picture of another frame": (p.other_picture(FRAME, 3), "the picture"),
    "channels swapped": (p.picture(FRAME, lambda x: x[..., ::-1]), "colour channels are in the order"),
    "16 bits where 8 are said": (p.picture(FRAME, lambda x: x.astype(np.uint16) * 257), "16 bits"),
    "part ids permuted": (p.arrays(FRAME, permuted), "part_id"),
    "part ids zero": (p.arrays(FRAME, no_parts), "part_id"),
    "normals flat": (p.arrays(FRAME, flat), "normal_cam is not the mesh's"),
    "share of light": (p.line(FRAME, fraction_lit=0.3), "fraction_lit is 0.3"),
    "triangle gone": (without_a_triangle, "are not those that the scenario builds"),
    "velocity of the wrong sign": (
        p.line(FRAME, v_body_cam_m_s=negative),
        "v_body_cam_m_s is",
    ),
    "trajectory's velocity of the wrong sign": (
        p.motion(v_chaser_rtn_m_s=np.negative),
        "from v_chaser_rtn_m_s",
    ),
    "epoch shifted": (
        p.motion(epoch_utc=lambda x: np.array(str(x).replace("T02:", "T03:"))),
        "s from that of epoch and t_s",
    ),
    "epoch of one line shifted": (
        p.line(FRAME, epoch_utc="2022-01-31T03:09:00.000000"),
        "s after the trajectory's epoch",
    ),
    "exposure not the scenario's": (p.line(FRAME, exposure_s=0.004), "exposure_s is 0.004"),
    "pixel pitch": (p.data("camera.json", set_in("ppx", lambda x: 2 * x)), "fx / ppx"),
    "symmetry is no rotation": (
        p.data("spacecraft/aqua.json", set_in("symmetries", [[[1, 0, 0], [0, 1, 0], [0, 0, -1]]])),
        "is no rotation",
    ),
    "skeleton names no keypoint": (
        p.data("spacecraft/aqua.json", set_in("skeleton", 0, ["T1", "none"])),
        "which is no keypoint",
    ),
    "time negative": (
        p.both(p.motion(t_s=np.negative), p.lines(lambda x: [y.update(t_s=-y["t_s"]) for y in x])),
        "before the epoch",
    ),
    "times zero": (
        p.both(p.motion(t_s=np.zeros_like), p.lines(lambda x: [y.update(t_s=0.0) for y in x])),
        "not after the frame before",
    ),
    "scenario's seed": (p.data("scenario.yaml", set_in("seed", 99)), "seed is 99"),
    "scenario's exposure": (
        p.data("scenario.yaml", set_in("sensor", "exposure_s", 0.001)),
        "the scenario's is 0.001",
    ),
    "coco: annotation ids": (p.data("coco.json", doubled), "two annotations have the id"),
    "coco: num_keypoints": (
        p.data("coco.json", lambda x: annotation(x).update(num_keypoints=3)),
        "num_keypoints is 3",
    ),
    "coco: skeleton from zero": (
        p.data(
            "coco.json", set_in("categories", 0, "skeleton", lambda x: [[a - 1, b - 1] for a, b in x])
        ),
        "skeleton",
    ),
    "coco: width and height": (p.data("coco.json", size_swapped), "width is 180"),
    "coco: iscrowd": (
        p.data("coco.json", lambda x: annotation(x).update(iscrowd=1)),
        "iscrowd is 1",
    ),
    "bop: cam_K": (
        p.data(f"{SCENE}/scene_camera.json", set_in(str(FRAME), "cam_K", 0, 100.0)),
        "cam_K",
    ),
    "bop: camera.json": (p.data("bop/camera.json", set_in("fx", 100.0)), "fx is 100.0"),
    "bop: diameter": (p.data("bop/models/models_info.json", set_in("1", "diameter", 5.0)), "diameter"),
    "bop: model scaled": (scaled_model, "it is another mesh"),
    "bop: image of another": (p.other_picture(FRAME, 2, f"{SCENE}/rgb"), "it is another image"),
    "yolo: image of another": (p.other_picture(FRAME, 2, "yolo/images"), "it is another image"),
    "yolo: flip_idx": (
        p.data("yolo/data.yaml", set_in("flip_idx", lambda x: x[::-1])),
        "flip_idx",
    ),
    "posse: annotations": (
        p.data("posse/annotations.json", set_in("keypoints", f"images/{FRAME:06d}.png", "T1", 0, 5.0)),
        "T1",
    ),
    "posse: conjugate pose": (p.text("posse/pose_data.csv", conjugate), "pose_data.csv: line 3"),
}
"""Name of a fault → how it is planted, and a part of the message by which it must be found."""

BESIDE = {
    "all pictures one frame late": (
        p.both(*[p.other_picture(i, i + 1) for i in range(COUNT - 1)]),
        "the picture",
    ),
    "picture shifted up by 3 px": (p.picture(FRAME, shifted(0, -3)), "shifted by"),
    "picture shifted on both axes": (p.picture(FRAME, shifted(2, -2)), "shifted by (2, -2) px"),
    "picture shifted on both axes, the other way": (
        p.picture(FRAME, shifted(-2, -2)),
        "shifted by (-2, -2) px",
    ),
    "picture shifted down by 2 px": (p.picture(FRAME, shifted(0, 2)), "shifted by (0, 2) px"),
    "picture negative": (p.picture(FRAME, lambda x: 255 - x), "saturated"),
    "picture negative, before a black sky": (
        p.picture(FRAME, lambda x: np.where(x.max(axis=2, keepdims=True) > 8, 255 - x, x)),
        "channels are in the order BGR",
    ),
    "channels turned": (p.picture(FRAME, lambda x: x[..., [1, 2, 0]]), "channels are in the order"),
    "channels turned the other way": (
        p.picture(FRAME, lambda x: x[..., [2, 0, 1]]),
        "channels are in the order",
    ),
    "picture with an alpha channel": (
        p.picture(FRAME, lambda x: cv2.cvtColor(x, cv2.COLOR_BGR2BGRA)),
        "alpha channel",
    ),
    "picture of a frame two later": (p.other_picture(0, 2), "the picture shows something else"),
    "lower half of another frame": (halves_of_two, "it is another image"),
    "picture enlarged by 3 %": (p.picture(FRAME, enlarged(1.03)), "it is another image"),
    "picture turned by 5°": (
        p.picture(
            FRAME,
            lambda x: cv2.warpAffine(x, cv2.getRotationMatrix2D((119.5, 89.5), 5, 1), x.shape[1::-1]),
        ),
        "the picture",
    ),
    "picture cut and enlarged": (p.picture(FRAME, first_rows_dropped), "the picture"),
    "picture white": (p.picture(FRAME, lambda x: np.full_like(x, 255)), "are saturated"),
    "picture of noise": (
        p.picture(FRAME, lambda x: np.random.default_rng(0).integers(0, 256, x.shape, np.uint8)),
        "the picture",
    ),
    "picture a hundred times darker": (p.picture(FRAME, lambda x: x // 40), "too dark"),
    "grey where colour is said": (
        p.picture(FRAME, lambda x: cv2.cvtColor(x, cv2.COLOR_BGR2GRAY)),
        "1 channel(s)",
    ),
    "picture of half the size": (p.picture(FRAME, lambda x: x[::2, ::2]), "not the camera's size"),
    "depth in millimetres": (
        p.arrays(FRAME, lambda x: x.update(depth_m=x["depth_m"] * np.float32(1e3))),
        "depth_m is off the mesh",
    ),
    "depth upside down": (
        p.arrays(FRAME, lambda x: x.update(depth_m=x["depth_m"][::-1].copy())),
        "depth_m",
    ),
    "normals in the body's axes": (
        p.arrays(FRAME, lambda x: x.update(normal_cam=x["normal_cam"][..., [1, 2, 0]].copy())),
        "normal_cam",
    ),
    "arrays of another frame": (
        lambda folder: p.write(
            folder / f"truth/{FRAME:06d}.npz", (folder / "truth/000002.npz").read_bytes()
        ),
        "part_id",
    ),
    "lines exchanged but for their names": (
        p.lines(exchanged(1, 2, "t_s", "epoch_utc", "q_cam_from_body", "t_body_cam_m", "keypoints")),
        "t_s is",
    ),
    "keypoints of another frame": (p.lines(exchanged(1, 2, "keypoints")), "where the pose puts it"),
    "masks of another frame": (p.lines(exchanged(1, 2, "mask_rle")), "the mask"),
    "rates of another frame": (
        p.line(FRAME, omega_body_rad_s=lambda x: [10 * value for value in x]),
        "omega_body_rad_s is not the trajectory's",
    ),
    "camera's rate of the wrong sign": (
        p.line(FRAME, omega_camera_rad_s=negative),
        "omega_camera_rad_s is not the trajectory's",
    ),
    "velocity in km/s": (
        p.line(FRAME, v_body_cam_m_s=lambda x: [value / 1e3 for value in x]),
        "v_body_cam_m_s is",
    ),
    "Sun on the other side": (p.line(FRAME, sun_direction_body=negative), "phase_angle_rad"),
    "share of light of shadow": (p.line(FRAME, fraction_lit=lambda x: 1 - x), "fraction_lit is"),
    "exposure in milliseconds": (p.line(FRAME, exposure_s=2.0), "exposure_s is 2.0"),
    "another exposure in all lines": (
        p.both(
            p.lines(lambda x: [y.update(exposure_s=2.0) for y in x]),
            p.data("scenario.yaml", set_in("sensor", "exposure_s", 2.0)),
        ),
        "the target is too dark",
    ),
    "label of no annotator": (
        p.data("scenario.yaml", set_in("annotators", lambda x: x[1:])),
        "the scenario has no annotator",
    ),
    "annotator without its labels": (
        p.lines(lambda x: [y.pop("part_area_px") for y in x]),
        "part_area_px is not labelled",
    ),
    "scenario of another camera": (
        p.data("scenario.yaml", set_in("camera", "hfov_deg", 51.0)),
        "camera.json has another fx_px",
    ),
    "scenario of another spacecraft": (
        p.data("scenario.yaml", set_in("target", {"name": "cubesat"})),
        "the scenario has no such spacecraft",
    ),
    "scenario of another renderer": (
        p.data("manifest.json", set_in("renderer", "name", "mitsuba")),
        "the manifest's is mitsuba",
    ),
    "scenario of 16 bits": (
        p.data("scenario.yaml", set_in("sensor", "bit_depth", 16)),
        "sensor.bit_depth is 16",
    ),
    "scenario of one channel": (
        p.data("scenario.yaml", set_in("sensor", "color", "mono")),
        "sensor.color is mono",
    ),
    "keypoint moved in the spacecraft": (
        p.data("spacecraft/aqua.json", set_in("keypoints", "T1", 0, lambda x: x + 1.0)),
        "its keypoints are not those",
    ),
    "parts renamed": (
        p.data("spacecraft/aqua.json", set_in("parts", 0, "other")),
        "its parts are not those",
    ),
    "symmetry that there is not": (
        p.data("spacecraft/aqua.json", set_in("symmetries", [[[-1, 0, 0], [0, -1, 0], [0, 0, 1]]])),
        "its symmetries are not those",
    ),
    "camera turned upside down": (
        p.data("camera.json", set_in("cameraMatrix", 1, 2, lambda x: x + 5)),
        "camera.json has another cy_px",
    ),
    "chaser's position": (
        p.motion(r_chaser_eci_m=lambda x: x + np.array([10.0, 0, 0])),
        "r_chaser_eci_m is 10 m",
    ),
    "Earth's rotation": (
        p.motion(earth_rotation_rad=lambda x: x + 0.01),
        "earth_rotation_rad is",
    ),
    "times of the lines": (p.line(FRAME, t_s=3951.0), "t_s is 3951.0"),
    "coco: category's keypoints": (
        p.data("coco.json", set_in("categories", 0, "keypoints", lambda x: x[::-1])),
        "keypoints",
    ),
    "coco: sigmas": (p.data("coco.json", set_in("categories", 0, "sigmas", 0, 0.5)), "sigmas"),
    "coco: file names": (
        p.data("coco.json", set_in("images", 0, "file_name", "images/000001.png")),
        "twice",
    ),
    "coco: area of the box": (
        p.data("coco.json", lambda x: annotation(x).update(area=1.0)),
        "mask_area_px",
    ),
    "speed: metres in millimetres": (
        p.data("speed.json", set_in(FRAME, "r_Vo2To_vbs_true", lambda x: [1e3 * y for y in x])),
        "t_body_cam_m",
    ),
    "bop: depth of another frame": (p.other_picture(FRAME, 2, f"{SCENE}/depth"), "depth is not"),
    "bop: whole box": (
        p.data(f"{SCENE}/scene_gt_info.json", set_in(str(FRAME), 0, "bbox_obj", [0, 0, 5, 5])),
        "bbox_obj",
    ),
    "bop: share visible": (
        p.data(f"{SCENE}/scene_gt_info.json", set_in(str(FRAME), 0, "visib_fract", 0.1)),
        "visib_fract",
    ),
    "bop: whole mask of another": (
        lambda folder: p.write(
            folder / f"{SCENE}/mask/{FRAME:06d}_000000.png",
            (folder / f"{SCENE}/mask/000002_000000.png").read_bytes(),
        ),
        "it is another image",
    ),
    "yolo: an image left out": (
        p.text("yolo/train.txt", lambda x: "".join(x.splitlines(keepends=True)[1:])),
        "yolo/train.txt",
    ),
    "yolo: names": (p.data("yolo/data.yaml", set_in("kpt_names", 0, 0, "other")), "keypoints"),
    "posse: Sun": (
        p.text("posse/points.csv", lambda x: x.replace("camera_range_m", "camera_range_km")),
        "points.csv: line 1",
    ),
    "posse: file lost": (lambda folder: (folder / "posse/dataset.csv").unlink(), "missing"),
}
"""Likewise, faults that a reader of the list above would add."""

TABLE = OF_THE_ISSUE | BESIDE


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("table") / "d"
    posse.run("aqua", folder, renderer="raster", overrides=copy.deepcopy(SCENARIO))
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "d")
    return tmp_path / "d"


def prove(folder: Path) -> Report:
    return validate(Dataset(folder), lambda places, frames: places)


def messages(folder: Path) -> list[str]:
    return [fault.message for result in prove(folder).results for fault in result.faults]


@pytest.mark.slow
def test_the_dataset_is_sound_before_anything_is_planted(made):
    report = prove(made)
    assert [fault for result in report.results for fault in result.faults] == []
    (picture,) = [result for result in report.results if result.name == "picture"]
    assert picture.checked == COUNT


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLE)
def test_a_planted_fault_is_found(folder, name):
    plant, words = TABLE[name]
    plant(folder)
    with contextlib.suppress(FileNotFoundError):  # a lost file has no checksum
        p.seal(folder)
    found = messages(folder)
    assert any(words in message for message in found), found
