"""A dataset through a lens: made, proven, and refuted as a pinhole's."""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_run import make_small

LENS = [-0.3, 0.05, 0.01, -0.008, 0.0]
OPTIONS = (
    "target={name: cubesat}",
    "renderer.seconds=0",
    "camera.hfov_deg=60",
    f"camera.distortion={LENS}",
    "relative={roe_m: [0, 0, 0.4, 0, 0.4, 0]}",
    "annotators=[box, mask, parts, depth, normals, keypoints, pose]",
    "times={count: 3}",
)


@pytest.fixture(scope="module")
def lensed(posse_in, tmp_path_factory):
    return make_small(posse_in, tmp_path_factory.mktemp("lensed"), OPTIONS)


def test_it_is_proven_and_as_a_pinholes_refuted(posse, lensed):
    proof = posse("validate", lensed)
    assert proof.returncode == 0, proof.stdout
    camera = json.loads((lensed / "camera.json").read_text())
    assert camera["distCoeffs"] == LENS
    (lensed / "camera.json").write_text(json.dumps({**camera, "distCoeffs": [0.0] * 5}))
    refuted = posse("validate", lensed, "--json")
    (lensed / "camera.json").write_text(json.dumps(camera))
    failed = {c["name"] for c in json.loads(refuted.stdout)["checks"] if c["faults"]}
    assert {"keypoints", "whole-box", "mask", "depth"} <= failed


def keypoints_by_opencv(folder) -> int:
    """Compare keypoints with what a user has: the pose of speed.json, the lens of camera.json, OpenCV.
    Return how many."""
    camera = json.loads((folder / "camera.json").read_text())
    project = cv2.fisheye.projectPoints if camera["distModel"] == "fisheye" else cv2.projectPoints
    K, k = np.array(camera["cameraMatrix"]), np.array(camera["distCoeffs"])
    coco = json.loads((folder / "coco.json").read_text())
    craft = json.loads((folder / "spacecraft/cubesat.json").read_text())
    body = np.array([craft["keypoints"][name] for name in coco["categories"][0]["keypoints"]])
    poses = json.loads((folder / "speed.json").read_text())
    labelled = 0
    for annotation in coco["annotations"]:
        pose = poses[annotation["image_id"]]
        w, x, y, z = pose["q_vbs2tango_true"]
        points = Rotation.from_quat([x, y, z, w]).apply(body) + pose["r_Vo2To_vbs_true"]
        uv = project(points[:, None], np.zeros(3), np.zeros(3), K, k)[0][:, 0]
        u, v, seen = np.reshape(annotation["keypoints"], (-1, 3)).T
        shown = seen > 0
        labelled += shown.sum()
        np.testing.assert_allclose(np.column_stack([u, v])[shown], uv[shown], atol=1e-6)
    return labelled


def test_coco_keypoints_are_opencvs_by_camera_json_and_speed_json(lensed):
    assert keypoints_by_opencv(lensed) > 10


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("brown-conrady", [0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02]),
        ("fisheye", [-0.02, 0.01, -0.003, 0.0005]),
    ],
)
def test_a_dataset_of_another_lens_is_proven_too(posse, posse_in, tmp_path, model, coefficients):
    near = ("camera.hfov_deg=100", "relative={roe_m: [0, 0, 0.2, 0, 0.2, 0]}")
    lens = (f"camera.distortion_model={model}", f"camera.distortion={coefficients}")
    folder = make_small(posse_in, tmp_path, (*OPTIONS, *near, *lens))
    proof = posse("validate", folder)
    assert proof.returncode == 0, proof.stdout
    camera = json.loads((folder / "camera.json").read_text())
    assert (camera["distModel"], camera["distCoeffs"]) == (model, coefficients)
    assert keypoints_by_opencv(folder) > 10
