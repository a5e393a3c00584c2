"""``posse.pose`` and ``posse.detector``, as a program uses them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import posse_core as posse

CAMERA = posse.Camera(1280, 960, 900.0, 900.0, 639.5, 479.5, 0.036)
POINTS_BODY_M = np.array(
    [[-4, -1, -1], [4, -1, 0], [4, 2, 1], [-4, 2, -2], [0, 8, 0.5], [1, -3, 3], [2, 2, -3]], dtype=float
)


@given(st.integers(0, 2**32 - 1))
def test_the_pose_of_exact_points_is_the_one_that_projected_them(seed: int) -> None:
    """The projection is written out here, with SciPy's rotation."""
    draw = np.random.default_rng(seed)
    rotation = Rotation.random(random_state=seed)
    t_m = np.array([draw.uniform(-5, 5), draw.uniform(-4, 4), draw.uniform(25, 60)])
    x, y, z = (rotation.apply(POINTS_BODY_M) + t_m).T
    points_px = np.stack([900.0 * x / z + 639.5, 900.0 * y / z + 479.5], axis=1)
    pose = posse.pose(POINTS_BODY_M, points_px, CAMERA, 0.5)
    assert pose is not None
    np.testing.assert_allclose(pose.t_body_cam_m, t_m, atol=1e-5)
    w, *vector = pose.q_cam_from_body
    assert (Rotation.from_quat([*vector, w]).inv() * rotation).magnitude() < 1e-6
    assert pose.range_m == pytest.approx(np.linalg.norm(t_m), abs=1e-5)
    assert repr(pose).endswith("m, 7 inliers>")


def test_three_points_have_no_pose() -> None:
    assert posse.pose(POINTS_BODY_M[:3], np.zeros((3, 2)), CAMERA) is None


@pytest.mark.parametrize(
    ("points_m", "points_px", "sigma_px", "expected"),
    [
        (POINTS_BODY_M, np.zeros((6, 2)), 1.0, "points_px (6, 2)"),
        (POINTS_BODY_M[:, :2], np.zeros((7, 2)), 1.0, "points_body_m is (7, 2)"),
        (POINTS_BODY_M, np.full((7, 2), np.nan), 1.0, "a point is not finite"),
        (POINTS_BODY_M, np.zeros((7, 2)), 0.0, "a standard deviation not above 0"),
        (POINTS_BODY_M, np.zeros((7, 2)), [1.0, 2.0], "sigma_px is (2,)"),
    ],
)
def test_points_that_do_not_fit_are_refused(points_m, points_px, sigma_px, expected) -> None:
    with pytest.raises(posse.InputError) as refused:
        posse.pose(points_m, points_px, CAMERA, sigma_px)
    assert expected in str(refused.value)
    assert "\n" not in json.dumps(str(refused.value))


def test_a_detector_of_a_file_that_is_missing_is_refused(tmp_path) -> None:
    with pytest.raises(posse.InputError, match=r"none\.onnx: there is no such file"):
        posse.detector(tmp_path / "none.onnx")


def test_a_detector_without_keypoints_says_so_when_asked_for_a_pose() -> None:
    class Everywhere(posse.Detector):
        classes = ("craft",)

        def load(self, path):
            pass

        def predict(self, images):
            return [[posse.Detection("craft", 1.0, np.array([0, 0, 9, 9]))] for _ in images]

    finder = posse.PoseDetector(Everywhere(posse.NoOptions()), None)
    image = np.zeros((20, 20), np.uint8)
    assert [d.label for d in finder.detect(image)] == ["craft"]
    with pytest.raises(posse.InputError, match="a pose needs keypoints"):
        finder.pose(image, CAMERA)
