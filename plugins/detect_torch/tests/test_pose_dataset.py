"""PoseDataset: poses and keypoints by OpenCV and SciPy, whichever layout the frames come in."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from torch.utils.data import DataLoader

from posse_core import InputError, preset_camera
from posse_detect_torch import PoseDataset

POINTS = np.array(
    [[-0.37, -0.39, 0], [-0.37, 0.26, 0], [0.37, 0.38, 0.32], [0.3, -0.58, 0.25], [0, 0, 0.3]]
)
CAMERA = preset_camera("speed-plus")
POSES = [
    (Rotation.from_rotvec([0.4, -1.9, 0.7]), np.array([0.3, -0.2, 6.0])),
    (Rotation.from_rotvec([-1.2, 0.3, 2.1]), np.array([-1.1, 0.9, 8.5])),
    (Rotation.from_rotvec([2.8, 0.1, -0.6]), np.array([0.05, 0.02, 12.0])),
]


def opencv(rotation: Rotation, t_m: np.ndarray, camera=CAMERA, points=POINTS) -> np.ndarray:
    """(K, 2) pixels by OpenCV, whose own attitude is a rotation vector."""
    lens = camera.matrix, camera.distortion_coefficients
    return cv2.projectPoints(points, rotation.as_rotvec(), t_m, *lens)[0][:, 0]


def write_images(folder: Path, camera) -> list[str]:
    """One image a pose, with a bright dot where OpenCV sees the first point."""
    folder.mkdir(parents=True)
    names = []
    for number, (rotation, t_m) in enumerate(POSES):
        image = np.zeros((camera.height_px, camera.width_px), np.uint8)
        cv2.circle(image, np.round(opencv(rotation, t_m, camera)[0]).astype(int).tolist(), 4, 255, -1)
        names.append(f"img{number:06}.png")
        cv2.imwrite(str(folder / names[-1]), image)
    return names


def write_labels(path: Path, names: list[str], key: str) -> None:
    """As SPEED and SPEED+ have them: SciPy's quaternion with its scalar moved to the front."""
    entries = [
        {
            "filename": name,
            key: np.roll(rotation.as_quat(), 1).tolist(),
            "r_Vo2To_vbs_true": t_m.tolist(),
        }
        for name, (rotation, t_m) in zip(names, POSES, strict=True)
    ]
    path.write_text(json.dumps(entries))


@pytest.fixture(scope="module")
def speed_plus(tmp_path_factory) -> Path:
    """``camera.json``, ``synthetic/{train,validation}.json``, ``synthetic/images/``."""
    root = tmp_path_factory.mktemp("speedplusv2")
    names = write_images(root / "synthetic" / "images", CAMERA)
    write_labels(root / "synthetic" / "train.json", names, "q_vbs2tango_true")
    write_labels(root / "synthetic" / "validation.json", names, "q_vbs2tango_true")
    camera = {
        "Nu": 1920,
        "Nv": 1200,
        "ppx": 5.86e-6,
        "ppy": 5.86e-6,
        "fx": 0.017513075965995915,
        "fy": 0.017511673079277208,
        "ccx": 960,
        "ccy": 600,
        "cameraMatrix": CAMERA.matrix.tolist(),
        "distCoeffs": CAMERA.distortion_coefficients.tolist(),
    }
    (root / "camera.json").write_text(json.dumps(camera))
    return root


@pytest.fixture(scope="module")
def speed(tmp_path_factory) -> Path:
    """``train.json`` and ``images/train/``, without a camera; test labels are names alone."""
    root = tmp_path_factory.mktemp("speed")
    names = write_images(root / "images" / "train", preset_camera("speed"))
    write_labels(root / "train.json", names, "q_vbs2tango")
    (root / "test.json").write_text(json.dumps([{"filename": names[0]}]))
    return root


@pytest.mark.parametrize("layout", ["SPEED", "SPEED+"])
def test_keypoints_are_where_opencv_and_the_image_have_them(speed, speed_plus, layout):
    if layout == "SPEED":
        camera = preset_camera("speed")
        assert camera.distortion is None
        given = PoseDataset(speed, "train", camera=camera, keypoints_body_m={"tango": POINTS})
    else:
        camera = CAMERA
        given = PoseDataset(speed_plus / "synthetic" / "train.json", keypoints_body_m={"tango": POINTS})
    assert len(given) == len(POSES)
    assert given.classes == ("tango",)
    for sample, (rotation, t_m) in zip(given, POSES, strict=True):
        turned = Rotation.from_quat(sample.q_cam_from_body.numpy()[[1, 2, 3, 0]])
        assert (turned * rotation.inv()).magnitude() < 1e-6
        np.testing.assert_allclose(sample.t_body_cam_m, t_m, rtol=1e-6)
        np.testing.assert_allclose(sample.K, camera.matrix, rtol=1e-6)
        np.testing.assert_allclose(sample.distortion, camera.distortion_coefficients, rtol=1e-6)
        expected = opencv(rotation, t_m, camera)
        np.testing.assert_allclose(sample.keypoints_px, expected, atol=1e-3)
        inside = ((expected >= 0) & (expected <= [1919, 1199])).all(axis=1)
        assert sample.visibility.tolist() == np.where(inside, -1, 0).tolist()
        v, u = np.nonzero(sample.image[0].numpy())
        np.testing.assert_allclose([u.mean(), v.mean()], sample.keypoints_px[0], atol=1)
        assert (sample.image.shape, sample.image.max()) == ((1, 1200, 1920), 1)
        assert torch.isnan(sample.box_px).all()
    with pytest.raises(IndexError):
        given[len(POSES)]
    assert given[-1].name == given[2].name


def test_a_dataset_and_its_exports_give_the_same_frames(dataset, posse, tmp_path):
    """POSSE's own folder against OpenCV, its SPEED and its COCO against that."""
    folder = Path(shutil.copytree(dataset.folder, tmp_path / "d"))
    code, _, errors = posse("export", folder, "--format", "speed", "--format", "coco")
    assert code == 0, errors
    ours, coco = PoseDataset(folder), PoseDataset(folder / "coco.json")
    points = ours.keypoints_body_m
    assert (ours.classes, {len(p) for p in points.values()}) == (("brick", "plate"), {8})
    speed = PoseDataset(folder / "speed.json", keypoints_body_m={"tango": points["brick"]})
    assert len(ours) == len(coco) == len(speed) == len(dataset)
    for index in range(8):
        sample, line = ours[index], dataset[index]
        craft = ours.classes[sample.label]
        assert craft == line.spacecraft
        rotation = Rotation.from_quat(sample.q_cam_from_body.double().numpy()[[1, 2, 3, 0]])
        t_m = sample.t_body_cam_m.double().numpy()
        seen = opencv(rotation, t_m, dataset.camera, points[craft])
        np.testing.assert_allclose(sample.keypoints_px, seen, atol=1e-3)
        assert sample.visibility.tolist() == [v for _, _, v in line.keypoints.values()]
        np.testing.assert_array_equal(sample.box_px, np.float32(line.box_visible_px))
        grey = cv2.imread(str(folder / sample.name), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(np.round(255 * sample.image[0].numpy()), grey)

        for other in (coco[index], speed[index]):
            assert torch.equal(other.image, sample.image)
            assert torch.equal(other.K, sample.K)
        assert torch.equal(coco[index].label, sample.label)
        assert torch.equal(coco[index].box_px, sample.box_px)
        assert torch.equal(coco[index].visibility, sample.visibility)
        labelled = sample.visibility > 0
        assert torch.equal(coco[index].keypoints_px[labelled], sample.keypoints_px[labelled])
        assert torch.isnan(coco[index].q_cam_from_body).all()
        assert torch.equal(speed[index].q_cam_from_body, sample.q_cam_from_body)
        assert torch.equal(speed[index].t_body_cam_m, sample.t_body_cam_m)
        if craft == "brick":
            torch.testing.assert_close(speed[index].keypoints_px, sample.keypoints_px, rtol=0, atol=1e-3)


def test_parts(dataset, speed_plus, speed):
    assert len(PoseDataset(dataset.folder, "valid")) == len(dataset.part("valid"))
    assert len(PoseDataset(speed_plus / "synthetic", "validation")) == len(POSES)
    with pytest.raises(InputError, match="choose one, such as part='train'"):
        PoseDataset(speed)


def test_batches_by_a_spawned_worker(dataset):
    given = PoseDataset(dataset.folder)
    loader = DataLoader(given, batch_size=4, num_workers=1, multiprocessing_context="spawn")
    batch = next(iter(loader))
    assert batch.image.shape == (4, 1, dataset.camera.height_px, dataset.camera.width_px)
    assert batch.q_cam_from_body.shape == (4, 4)
    assert batch.keypoints_px.shape == (4, 8, 2)
    for index in range(4):
        for one, many in zip(given[index], batch, strict=True):
            if isinstance(one, str):
                assert one == many[index]
            else:
                torch.testing.assert_close(one, many[index], rtol=0, atol=0, equal_nan=True)


def test_what_is_wrong_is_said(speed, speed_plus, tmp_path):
    with pytest.raises(InputError, match=r"train\.json: has no camera\.json .*preset_camera\('speed'\)"):
        PoseDataset(speed / "train.json")
    with pytest.raises(InputError, match=r"test\.json: not poses of SPEED"):
        PoseDataset(speed / "test.json", camera=CAMERA)
    with pytest.raises(InputError, match=r"keypoints_body_m: .* has no spacecraft aqua .*it has tango"):
        PoseDataset(speed_plus / "synthetic/train.json", keypoints_body_m={"aqua": POINTS})
    with pytest.raises(InputError, match=r"keypoints_body_m: tango: has shape \(3,\), .* \(K, 3\)"):
        PoseDataset(speed_plus / "synthetic/train.json", keypoints_body_m={"tango": POINTS[0]})
    smaller = PoseDataset(speed / "train.json", camera=replace(CAMERA, width_px=640, height_px=400))
    with pytest.raises(InputError, match=r"img000000\.png: is 1920 × 1200 pixels, .* 640 × 400"):
        smaller[0]
    labels = tmp_path / "train.json"
    write_labels(labels, ["../a.png", "b.png", "c.png"], "q_vbs2tango")
    with pytest.raises(InputError, match=r"'\.\./a\.png' is outside the labels' folder"):
        PoseDataset(labels, camera=CAMERA)
    write_labels(labels, ["a.png", "b.png", "c.png"], "q_vbs2tango")
    with pytest.raises(InputError, match=r"its image a\.png is in none of"):
        PoseDataset(labels, camera=CAMERA)
    with pytest.raises(InputError, match="there is no such folder"):
        PoseDataset(tmp_path / "none")


def test_the_documented_example(dataset, monkeypatch, tmp_path):
    text = (Path(__file__).parents[3] / "docs" / "detector.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?PoseDataset.*?)```", text, flags=re.S)
    shutil.copytree(dataset.folder, tmp_path / "d")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, "docs/detector.md", "exec"), names)
    assert names["batch"].image.shape[0] == 16
