"""Calibrations of several cameras, as their programs read them, against the labels of each camera."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from small_run import make_small

from posse_core._cli.export import command
from posse_core._dataset.camera import write_camera
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.sensors import SensorInfo, write_sensor
from posse_core._errors import InputError
from posse_core._formats.kalibr import KalibrWriter
from posse_core._formats.opencv_calibration import OpencvCalibrationWriter
from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._model.mount import Mount
from posse_core._plugins.options import NoOptions

LENS = [-0.06, 0.01, 0.001, -0.002, 0.0]
SIDE = "{width_px: 160, height_px: 120, hfov_deg: 40, distortion: [0.02, 0.01, -0.001, 0.002, 0]}"
FISHEYE = (
    "{width_px: 160, height_px: 120, focal_px: [120, 122], centre_px: [81.2, 58.3],"
    " distortion_model: fisheye, distortion: [-0.02, 0.01, -0.003, 0.0005]}"
)
OPTIONS = (
    "target={name: aqua}",
    f"camera={{width_px: 160, height_px: 120, focal_px: [180, 175], distortion: {LENS}}}",
    "relative={roe_m: [0, 0, 15, 0, 15, 0]}",
    "times={duration_orbits: 0.5, count: 2}",
    "renderer.seconds=0",
    f"sensors.a={{type: camera, camera: {SIDE},"
    " mount: {position_m: [0.8, 0.1, -0.05], rotation_vector_deg: [1, -3, 2]}}",
    "sensors.b={type: camera, mount: {position_m: [0, 0.6, 0]}}",
    "sensors.c={type: camera, mount: {rotation_vector_deg: [0, 0, 5]}}",
    "sensors.d={type: camera, mount: {position_m: [1, 0, 0]},"
    " camera: {width_px: 64, height_px: 48, hfov_deg: 60}}",
    f"sensors.e={{type: camera, camera: {FISHEYE}, mount: {{position_m: [0.5, 0, 0]}}}}",
    f"sensors.f={{type: camera, camera: {FISHEYE},"
    " mount: {position_m: [-0.3, 0.1, 0], rotation_vector_deg: [1, -3, 2]}}",
)
FORMATS = ("--format", "opencv-calibration", "--format", "kalibr")


@pytest.fixture(scope="module")
def folder(posse_in, tmp_path_factory):
    """Aqua and seven cameras: the chaser's with a lens, one turned, one below, one in its place, one
    small, two fisheyes."""
    made = make_small(posse_in, tmp_path_factory.mktemp("cameras"), OPTIONS)
    done = CliRunner().invoke(command, [str(made), *FORMATS])
    assert done.exit_code == 0, done.output
    return made


def keypoints_px(points) -> np.ndarray:
    return np.array([[point[0], point[1]] for point in points], dtype=float)


def labelled_px(dataset: Dataset, i: int) -> dict[str, np.ndarray]:
    """Labelled positions of the keypoints in each camera's image."""
    (beside,) = zip(*(dataset[i].sensors[name] for name in "abcdef"), strict=True)
    labels = dict(zip("abcdef", beside, strict=True))
    found = {
        name: keypoints_px(labels[name].labels["keypoints"][key] for key in dataset[i].keypoints)
        for name in labels
    }
    return {"camera": keypoints_px(dataset[i].keypoints.values()), **found}


def in_the_camera(dataset: Dataset, i: int) -> np.ndarray:
    points = np.array([*dataset.spacecraft.keypoints_body_m.values()])
    R = Rotation.from_quat(np.roll(dataset[i].q_cam_from_body, -1)).as_matrix()
    return points @ R.T + dataset[i].t_body_cam_m


def opencv(folder, name: str) -> dict[str, np.ndarray]:
    path = folder / "opencv-calibration" / f"{name}.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened()
    # OpenCV's node is no mapping: it cannot be iterated but by its keys.
    nodes = {key: storage.getNode(key) for key in storage.root().keys()}  # noqa: SIM118
    return {key: node.mat() if node.isMap() else node.real() for key, node in nodes.items()}


def test_opencv_projects_the_keypoints_where_each_camera_labels_them(folder):
    dataset = Dataset(folder)
    for i in range(2):
        x_m, labelled = in_the_camera(dataset, i), labelled_px(dataset, i)
        for name, uv_px in labelled.items():
            found = opencv(folder, name if name == "camera" else f"sensors/{name}")
            R, T = found.get("R", np.eye(3)), found.get("T", np.zeros(3))
            lens = found["camera_matrix"], found["distortion_coefficients"]
            assert found["fisheye_model"] == (name in ("e", "f"))
            project = cv2.fisheye.projectPoints if found["fisheye_model"] else cv2.projectPoints
            expected, _ = project(x_m[:, None], cv2.Rodrigues(R)[0], T, *lens)
            assert np.abs(expected[:, 0] - uv_px).max() < 1e-9, name
            camera = dataset.camera if name == "camera" else dataset.sensors[name].camera
            assert camera is not None
            assert (found["image_width"], found["image_height"]) == (camera.width_px, camera.height_px)


@pytest.mark.parametrize(("name", "along"), [("a", 1), ("b", 0)])
def test_after_opencvs_rectification_both_eyes_have_a_point_in_one_row(folder, name, along):
    """Labelled keypoints of the two images, undistorted and rectified by cv2, differ only along the
    baseline, and Q gives the point; one sensor is beside the camera and one below it."""
    dataset, pair = Dataset(folder), opencv(folder, f"sensors/{name}")
    left, labelled = opencv(folder, "camera"), labelled_px(dataset, 0)
    rectified = [
        cv2.undistortPoints(
            uv_px[:, None],
            lens["camera_matrix"],
            lens["distortion_coefficients"],
            R=pair[f"R{eye}"],
            P=pair[f"P{eye}"],
        )[:, 0]
        for eye, lens, uv_px in ((1, left, labelled["camera"]), (2, pair, labelled[name]))
    ]
    apart_px = rectified[0] - rectified[1]
    assert np.abs(apart_px[:, along]).max() < 1e-5
    d_px = apart_px[:, 1 - along]
    assert d_px.min() > 1
    found = np.column_stack([*rectified[0].T, d_px, np.ones(len(d_px))]) @ pair["Q"].T
    expected_m = in_the_camera(dataset, 0) @ pair["R1"].T
    np.testing.assert_allclose(found[:, :3] / found[:, 3:], expected_m, rtol=0, atol=1e-5)


def test_there_is_no_rectification_from_one_place_or_for_two_sizes_or_kinds(folder):
    for name in "cdef":  # e and f are fisheyes beside a camera that is none
        assert opencv(folder, f"sensors/{name}").keys().isdisjoint({"R1", "R2", "P1", "P2", "Q"})
        assert opencv(folder, f"sensors/{name}").keys() >= {"R", "T"}


def test_kalibrs_chain_leads_to_the_labels_of_each_camera(folder):
    """Each T_cn_cnm1 takes points from the camera before; radtan is k1, k2, p1, p2 of OpenCV."""
    dataset = Dataset(folder)
    chain = yaml.safe_load((folder / "camchain.yaml").read_text())
    assert [*chain] == [f"cam{n}" for n in range(7)]
    labelled = labelled_px(dataset, 1)
    x_m = in_the_camera(dataset, 1)
    for camera, (name, uv_px) in zip(chain.values(), labelled.items(), strict=True):
        if name != "camera":
            T = np.array(camera["T_cn_cnm1"])
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
            x_m = x_m @ T[:3, :3].T + T[:3, 3]
        fu, fv, pu, pv = camera["intrinsics"]
        K = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
        zero = np.zeros(3)
        model = "equidistant" if name in ("e", "f") else "radtan"
        project = cv2.fisheye.projectPoints if name in ("e", "f") else cv2.projectPoints
        expected, _ = project(x_m[:, None], zero, zero, K, np.array(camera["distortion_coeffs"]))
        assert np.abs(expected[:, 0] - uv_px).max() < 1e-9, name
        assert camera["camera_model"] == "pinhole"
        assert camera["distortion_model"] == model
        assert camera["rostopic"] == (
            "/camera/image_raw" if name == "camera" else f"/sensors/{name}/image_raw"
        )
    assert chain["cam4"]["resolution"] == [64, 48]


def test_opencv_rectifies_a_rectified_pair_by_leaving_it_as_it_is(dataset_folder, tmp_path):
    """cv2.stereoRectify gives what was exported."""
    folder = shutil.copytree(dataset_folder, tmp_path / "d")
    camera = Dataset(folder).camera
    (folder / "sensors").mkdir()
    info = SensorInfo("right", "stereo", Mount(np.array([0.3, 0, 0])), None, camera, {})
    write_sensor(info, folder / "sensors/right.json")
    OpencvCalibrationWriter(NoOptions()).write(Dataset(folder), folder)
    left, right = opencv(folder, "camera"), opencv(folder, "sensors/right")
    lenses = [x[key] for x in (left, right) for key in ("camera_matrix", "distortion_coefficients")]
    size = camera.width_px, camera.height_px
    found = cv2.stereoRectify(
        *lenses, size, right["R"], right["T"], flags=cv2.CALIB_ZERO_DISPARITY, alpha=-1
    )
    np.testing.assert_array_equal(right["R1"], np.eye(3))
    np.testing.assert_array_equal(right["R2"], np.eye(3))
    for key, matrix in zip(("R1", "R2", "P1", "P2", "Q"), found[:5], strict=True):
        np.testing.assert_allclose(right[key], matrix, rtol=1e-12, atol=1e-12)


def test_two_fisheyes_are_rectified_by_opencvs_fisheye(dataset_folder, tmp_path):
    """Directions of points in both images, undistorted and rectified by cv2, differ along the baseline
    only."""
    folder = shutil.copytree(dataset_folder, tmp_path / "d")
    camera = replace(Dataset(folder).camera, distortion=Fisheye(-0.02, 0.01, -0.003, 0.0005))
    write_camera(camera, folder / "camera.json")
    (folder / "sensors").mkdir()
    R = Rotation.from_rotvec([0.02, -0.05, 0.03]).as_matrix()
    mount = Mount(np.array([0.4, 0.05, 0.02]), R)
    write_sensor(SensorInfo("side", "camera", mount, None, camera, {}), folder / "sensors/side.json")
    OpencvCalibrationWriter(NoOptions()).write(Dataset(folder), folder)
    pair = opencv(folder, "sensors/side")
    x_m = np.random.default_rng(0).uniform([-2, -1.5, 4], [2, 1.5, 9], (40, 3))
    rectified = []
    for eye, points_m in ((1, x_m), (2, (x_m - mount.position_m) @ R)):
        K, D = pair["camera_matrix"], pair["distortion_coefficients"]
        uv = cv2.fisheye.projectPoints(points_m[:, None], np.zeros(3), np.zeros(3), K, D)[0]
        R_eye, P = pair[f"R{eye}"], pair[f"P{eye}"]
        rectified.append(cv2.fisheye.undistortPoints(uv, K, D, R=R_eye, P=P)[:, 0])
    assert np.abs(rectified[0] - rectified[1])[:, 1].max() < 1e-4
    assert (rectified[0] - rectified[1])[:, 0].min() > 1


def test_kalibr_refuses_a_rational_lens(dataset_folder, tmp_path):
    folder = shutil.copytree(dataset_folder, tmp_path / "d")
    camera = replace(Dataset(folder).camera, distortion=BrownConrady(k4=0.01))
    write_camera(camera, folder / "camera.json")
    with pytest.raises(InputError, match=r"Kalibr cannot describe OpenCV's rational lens.*opencv-calib"):
        KalibrWriter(NoOptions()).write(Dataset(folder), folder)


def test_kalibr_refuses_k3_and_says_what_to_do(dataset_folder, tmp_path):
    folder = shutil.copytree(dataset_folder, tmp_path / "d")
    camera = replace(Dataset(folder).camera, distortion=BrownConrady(k3=0.01))
    write_camera(camera, folder / "camera.json")
    words = r"the lens of camera has k3 = 0.01, .*make the dataset with k3 = 0, or export opencv-calib"
    with pytest.raises(InputError, match=words):
        KalibrWriter(NoOptions()).write(Dataset(folder), folder)


def test_a_dataset_without_sensors_has_one_camera(dataset_folder, tmp_path):
    arguments = [str(dataset_folder), *FORMATS, "--out", str(tmp_path)]
    done = CliRunner().invoke(command, arguments)
    assert done.exit_code == 0, done.output
    assert [*yaml.safe_load((tmp_path / "camchain.yaml").read_text())] == ["cam0"]
    assert [path.name for path in (tmp_path / "opencv-calibration").iterdir()] == ["camera.yaml"]
    camera = Dataset(dataset_folder).camera
    found = opencv(tmp_path, "camera")
    np.testing.assert_array_equal(found["camera_matrix"], camera.matrix)
    np.testing.assert_array_equal(found["distortion_coefficients"].ravel(), np.zeros(5))
