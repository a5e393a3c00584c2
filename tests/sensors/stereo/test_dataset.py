"""Datasets with a stereo pair: labels of the right eye, proof, planted faults, OpenCV."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from small_run import make_small

from posse_core._cli.export import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.sensors import SensorChecks
from posse_core._evaluation.validate import validate
from posse_core._interfaces.sensor import SensorSetting
from posse_core._model.distortion import BrownConrady
from posse_core._model.labels import Labels
from posse_core._model.mount import Mount
from posse_core._plugins.loading import Plugins
from posse_core._scenario.sensor import SensorConfig
from posse_core.testing.stage import craft

BASELINE_M = 0.7
OPTIONS = (
    "target={name: aqua}",
    "camera={width_px: 240, height_px: 180, focal_px: [300, 290], centre_px: [117, 93]}",
    "relative={roe_m: [0, 0, 12, 0, 12, 0]}",
    "times={duration_orbits: 0.6, count: 3}",
    "renderer.seconds=0",
)
STEREO = f"sensors={{right: {{type: stereo, baseline_m: {BASELINE_M}}}}}"


@pytest.fixture(scope="module")
def pair(posse_in, tmp_path_factory) -> Path:
    """Three views around Aqua, with their calibration; not to be changed."""
    folder = make_small(posse_in, tmp_path_factory.mktemp("pair"), (*OPTIONS, STEREO))
    done = CliRunner().invoke(command, [str(folder), "--format", "opencv-calibration"])
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture(scope="module")
def rolling(posse_in, tmp_path_factory) -> Path:
    """The same with a rolling shutter, turning at six degrees a second."""
    spin = "attitude.target={law: spin, body_axis: +x, rate_rpm: 1}"
    options = (*OPTIONS, STEREO, "camera.line_time_s=0.002", spin)
    return make_small(posse_in, tmp_path_factory.mktemp("rolling"), options)


@pytest.mark.parametrize("name", ["pair", "rolling"])
def test_it_proves_itself(name, request):
    report = validate(Dataset(request.getfixturevalue(name)), lambda places, frames: places)
    faulty = [result for result in report.results if result.faults]
    assert not faulty
    (result,) = [result for result in report.results if result.name == "sensor right"]
    assert result.checked == 3


def test_the_right_eye_has_labels_of_its_own(pair):
    """Keypoints by cv2 from the left eye's pose and the calibration's R and T; and the noise is not the
    left eye's."""
    dataset = Dataset(pair)
    calibration = read_calibration(pair, "sensors/right")
    points = np.array([*dataset.spacecraft.keypoints_body_m.values()])
    for i, labels in enumerate(dataset):
        (reading,) = dataset.readings(i, "right")
        R = Rotation.from_quat(np.roll(labels.q_cam_from_body, -1)).as_matrix()
        x_left = points @ R.T + labels.t_body_cam_m
        x_right = x_left @ calibration["R"].T + calibration["T"].ravel()
        expected, _ = cv2.projectPoints(
            x_right, np.zeros(3), np.zeros(3), calibration["camera_matrix"], None
        )
        said = np.array([point[:2] for point in reading.labels["keypoints"].values()], dtype=float)
        assert np.abs(said - expected[:, 0]).max() < 1e-9
        assert reading.image is not None
        assert reading.image.shape == dataset.image(i).shape
        assert (reading.image != dataset.image(i)).mean() > 0.3


def read_calibration(folder: Path, name: str) -> dict[str, np.ndarray]:
    path = folder / "opencv-calibration" / f"{name}.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    keys = storage.root().keys()
    return {key: storage.getNode(key).mat() for key in keys if storage.getNode(key).isMap()}


def test_opencv_reprojects_the_disparity_to_the_labelled_points(pair):
    """cv2.reprojectImageTo3D with the exported Q, in single precision, against the labelled depth along
    the rays of the camera matrix; fx is not fy, and the principal point is not central."""
    dataset, Q = Dataset(pair), read_calibration(pair, "sensors/right")["Q"]
    worst = 0.0
    for i, _ in enumerate(dataset):
        (reading,) = dataset.readings(i, "right")
        disparity_px = reading.arrays["disparity_left_px"]
        mask = dataset.mask(i)
        np.testing.assert_array_equal(np.isfinite(disparity_px), mask)
        found_m = cv2.reprojectImageTo3D(disparity_px, Q)[mask]
        v, u = np.nonzero(mask)
        z_m = dataset.depth(i)[mask].astype(float)
        expected_m = np.stack([(u - 117) / 300 * z_m, (v - 93) / 290 * z_m, z_m], axis=-1)
        off = np.linalg.norm(found_m - expected_m, axis=1) / np.linalg.norm(expected_m, axis=1)
        worst = max(worst, off.max())
    assert worst < 1e-6


def faults_of(folder: Path) -> list[str]:
    """What is wrong with the readings of the second frame."""
    dataset = Dataset(folder)
    checks = SensorChecks(dataset)
    checks.check(dataset[1])
    (result,) = checks.results
    return [fault.message for fault in result.faults]


def test_nothing_is_wrong_with_a_reading_as_it_was_made(pair):
    assert faults_of(pair) == []


def swap(arrays):
    arrays["disparity_left_px"], arrays["disparity_right_px"] = (
        arrays["disparity_right_px"],
        arrays["disparity_left_px"],
    )
    arrays["visibility_in_right"], arrays["visibility_in_left"] = (
        arrays["visibility_in_left"],
        arrays["visibility_in_right"],
    )


def other_baseline(arrays):
    arrays["disparity_left_px"] *= np.float32(1.001)


def shift(arrays):
    arrays["disparity_right_px"] = np.roll(arrays["disparity_right_px"], 3, axis=1)
    arrays["visibility_in_left"] = np.roll(arrays["visibility_in_left"], 3, axis=1)


def hide(arrays):
    arrays["visibility_in_left"][arrays["visibility_in_left"] == 2] = 1


def show(arrays):
    arrays["visibility_in_right"][arrays["visibility_in_right"] >= 0] = 0


def hole(arrays):
    rows, columns = np.nonzero(np.isfinite(arrays["disparity_left_px"]))
    half = rows < np.median(rows)
    arrays["disparity_left_px"][rows[half], columns[half]] = np.nan
    arrays["visibility_in_right"][rows[half], columns[half]] = -1


def torn(arrays):
    arrays["visibility_in_right"][:] = -1


def double(arrays):
    arrays["disparity_left_px"] = arrays["disparity_left_px"].astype(np.float64)


@pytest.mark.parametrize(
    ("alter", "words"),
    [
        (swap, "disparity of the right eye is not that of the mesh"),
        (other_baseline, "disparity of the left eye is not that of the mesh"),
        (shift, "the right eye"),
        (hide, "is not hidden in the other eye"),
        (show, "is not outside the image in the other eye"),
        (hole, "the left eye has no disparity at"),
        (torn, "do not have the same pixels"),
        (double, "disparity_left_px is not there, or not of the image's size and its type"),
    ],
)
def test_a_planted_fault_is_found(pair, tmp_path, alter, words):
    folder = Path(shutil.copytree(pair, tmp_path / "d"))
    path = folder / "sensors/right/000001.npz"
    arrays = dict(np.load(path))
    alter(arrays)
    np.savez(path, **arrays)
    faults = faults_of(folder)
    assert any(words in fault for fault in faults), faults


def test_an_eye_elsewhere_is_found(pair, tmp_path):
    folder = Path(shutil.copytree(pair, tmp_path / "d"))
    path = folder / "sensors/right.json"
    path.write_text(path.read_text().replace(f"{BASELINE_M}", "0.6", 1))
    assert any("m along the camera's x axis" in fault for fault in faults_of(folder))


@pytest.mark.parametrize(
    ("mount", "distortion", "words"),
    [
        (Mount(np.array([0.3, 0, 0])), None, "^baseline_m says where a stereo eye is; leave out mount$"),
        (
            Mount(R_camera_from_sensor=np.diag([-1.0, -1.0, 1.0])),
            None,
            "^baseline_m says where a stereo eye is; leave out mount$",
        ),
        (
            Mount(),
            BrownConrady(k1=0.1),
            "^disparity is that of rectified images, .* leave out camera.distortion, or use type: ",
        ),
    ],
)
def test_what_is_no_rectified_pair_is_refused_in_one_line(mount, distortion, words):
    sensor = Plugins([]).registry.create("sensor", "stereo")
    scene = craft()
    camera = replace(scene.camera, distortion=distortion)
    with pytest.raises(InputError, match=words) as caught:
        sensor.open(
            SensorSetting(
                "r", 1, replace(scene, camera=camera), SensorConfig(), mount, lambda look: Labels()
            )
        )
    assert "\n" not in str(caught.value)


def test_the_dataset_says_where_the_eye_is(pair):
    info = Dataset(pair).sensors["right"]
    assert info.mount.position_m.tolist() == [BASELINE_M, 0, 0]
    assert info.camera == Dataset(pair).camera
