"""Readings of a frame: true projections with noise, and what nets find."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import posse_core as posse
from posse_core._flight.expected import Expected
from posse_core._flight.eye import NetEye, TrueEye
from posse_core._scenario.flight import MeasurementConfig

CAMERA = posse.Camera(512, 384, 800.0, 800.0, 255.5, 191.5, 0.01)
POINTS_BODY_M = np.random.default_rng(3).uniform(-2, 2, (12, 3))
CRAFT = SimpleNamespace(
    name="box",
    keypoints_body_m={f"K{i}": x for i, x in enumerate(POINTS_BODY_M)},
    keypoint_joints={},
)
R_CAM_FROM_BODY = cv2.Rodrigues(np.array([0.4, -0.9, 0.2]))[0]
T_BODY_CAM_M = np.array([0.5, -0.3, 25.0])
TRUE_PX = cv2.projectPoints(POINTS_BODY_M, R_CAM_FROM_BODY, T_BODY_CAM_M, CAMERA.matrix, None)[0][:, 0]
Q = np.array([1.0, 0.0, 0.0, 0.0])
IMAGE = np.zeros((384, 512), np.uint8)


def labels(index=0, **changes):
    visibility = [2] * 10 + [1, 0]
    keypoints = {
        f"K{i}": posse.Keypoint(u, v, visibility[i]) for i, (u, v) in enumerate(TRUE_PX.tolist())
    }
    low, high = TRUE_PX.min(axis=0), TRUE_PX.max(axis=0)
    given = {
        "index": index,
        "t_s": 10.0 * index,
        "sun_fraction_target": 1.0,
        "box_visible_px": posse.Box(*low, *(high - low)),
        "keypoints": keypoints,
        "range_m": float(np.linalg.norm(T_BODY_CAM_M)),
    }
    return posse.LabelLine.model_construct(**{**given, **changes})


def true_eye(**options):
    return TrueEye(MeasurementConfig(source="truth", **options), CRAFT, CAMERA, 5)


def test_true_keypoints_have_noise_of_the_size_that_is_asked_for():
    eye = true_eye(sigma_px=1.5)
    off = np.array(
        [eye.read(labels(i), IMAGE, Q).keypoints.points_px - TRUE_PX[:10] for i in range(200)]
    )
    assert off.std() == pytest.approx(1.5, rel=0.03)
    assert np.abs(off.mean(axis=0)).max() < 5 * 1.5 / np.sqrt(200)


def test_hidden_and_outside_keypoints_are_not_read():
    keypoints = true_eye().read(labels(), IMAGE, Q).keypoints
    np.testing.assert_array_equal(keypoints.points_body_m, POINTS_BODY_M[:10])


def test_keypoints_that_a_joint_carries_are_not_read():
    """They are not where the spacecraft's file puts them."""
    craft = SimpleNamespace(**{**vars(CRAFT), "keypoint_joints": {"K0": "wing", "K9": "wing"}})
    eye = TrueEye(MeasurementConfig(source="truth"), craft, CAMERA, 5)
    keypoints = eye.read(labels(), IMAGE, Q).keypoints
    np.testing.assert_array_equal(keypoints.points_body_m, POINTS_BODY_M[1:9])
    whole = true_eye().read(labels(), IMAGE, Q).keypoints
    np.testing.assert_array_equal(keypoints.points_px, whole.points_px[1:9])


def test_the_noise_of_a_frame_depends_on_its_index_and_the_seed_alone():
    first, again, other = (true_eye().read(labels(i), IMAGE, Q).keypoints for i in (4, 4, 5))
    np.testing.assert_array_equal(first.points_px, again.points_px)
    assert np.abs(first.points_px - other.points_px).min() > 0


def test_nothing_is_read_in_eclipse_or_off_the_image():
    for changes in ({"sun_fraction_target": 0.0}, {"box_visible_px": None}):
        readings = true_eye(range_sigma_m=None).read(labels(**changes), IMAGE, Q)
        assert readings.keypoints is readings.pose is readings.line_of_sight is None


def test_the_pose_that_goes_with_keypoints_is_theirs():
    """Within five standard deviations of its own covariance, at a tenth of a pixel of noise."""
    pose = true_eye(sigma_px=0.1).read(labels(), IMAGE, Q).pose
    sigma_m = np.sqrt(np.diag(pose.covariance)[3:])
    assert np.all(np.abs(pose.t_body_cam_m - T_BODY_CAM_M) < 5 * sigma_m)
    assert np.all(sigma_m < 0.2)


@pytest.mark.parametrize(
    ("use", "given"),
    [
        ("keypoints", (True, True, False)),
        ("pose", (False, True, False)),
        ("line-of-sight", (False, False, True)),
    ],
)
def test_what_the_navigator_gets(use, given):
    readings = true_eye(use=use).read(labels(), IMAGE, Q)
    found = (readings.keypoints, readings.pose, readings.line_of_sight)
    assert tuple(part is not None for part in found) == given


def test_the_line_of_sight_is_through_the_middle_of_the_box():
    sight = true_eye(use="line-of-sight").read(labels(), IMAGE, Q).line_of_sight
    box = labels().box_visible_px
    u, v = 800 * sight.direction_cam[:2] / sight.direction_cam[2] + (255.5, 191.5)
    assert (u, v) == pytest.approx((box.x + (box.width - 1) / 2, box.y + (box.height - 1) / 2))
    true_direction = T_BODY_CAM_M / np.linalg.norm(T_BODY_CAM_M)
    off_rad = np.linalg.norm(np.cross(sight.direction_cam, true_direction))
    assert off_rad < 3 * sight.sigma_rad < 0.1


def test_a_range_finder_reads_the_range_with_its_noise():
    eye = true_eye(range_sigma_m=0.05)
    ranges = [eye.read(labels(i), IMAGE, Q).range for i in range(300)]
    off = np.array([reading.range_m for reading in ranges]) - np.linalg.norm(T_BODY_CAM_M)
    assert off.std() == pytest.approx(0.05, rel=0.15)
    assert {reading.sigma_m for reading in ranges} == {0.05}


def test_readings_arrive_after_the_delay_that_the_scenario_names():
    assert true_eye(delay_s=0.7).read(labels(3), IMAGE, Q).arrives_s == pytest.approx(30.7)
    assert true_eye(delay_s="measured").read(labels(3), IMAGE, Q).arrives_s > 30.0


class Finds:
    """Finds one spacecraft, with keypoints of a standard deviation."""

    def __init__(self, label, sigma_px):
        self.found = posse.Detection(
            label, 0.9, np.array([200.0, 150.0, 100.0, 80.0]), TRUE_PX, np.full(12, sigma_px)
        )

    def detect(self, image):
        return [self.found]


@pytest.mark.parametrize(
    ("label", "sigma_px", "read"), [("box", 1.9, True), ("box", 2.1, False), ("kite", 1.0, False)]
)
def test_detections_of_another_class_or_without_certainty_are_ignored(label, sigma_px, read):
    """The limit is 0.02 of the box's larger side, 100 px."""
    config = MeasurementConfig(sigma_px=1.2, largest_sigma=0.02)
    readings = NetEye(config, CRAFT, CAMERA, 0, Finds(label, sigma_px)).read(labels(), IMAGE, Q)
    assert (readings.keypoints is not None) == read
    if read:
        np.testing.assert_allclose(readings.keypoints.sigma_px, np.hypot(sigma_px, 1.2))


class FindsPlaces(Finds):
    """Finds two places of each keypoint: of the first five the likelier one is elsewhere, and of the
    last one both are."""

    def __init__(self, sigma_px):
        super().__init__("box", sigma_px)
        elsewhere_px = np.random.default_rng(4).uniform([200, 150], [300, 230], (12, 2))
        places_px = np.stack([TRUE_PX, elsewhere_px], axis=1)
        places_px[:5] = places_px[:5, ::-1]
        places_px[-1] = [[20.0, 20.0], [30.0, 30.0]]
        share = np.broadcast_to([0.55, 0.45], (12, 2))
        self.found = self.found.with_places(
            posse.KeypointPlaces(places_px, np.full((12, 2), sigma_px), share)
        )


def test_keypoints_are_read_at_the_places_that_agree_on_a_pose():
    eye = NetEye(MeasurementConfig(sigma_px=0.5), CRAFT, CAMERA, 0, FindsPlaces(0.3))
    readings = eye.read(labels(), IMAGE, Q)
    np.testing.assert_array_equal(readings.keypoints.points_body_m, POINTS_BODY_M[:-1])
    np.testing.assert_allclose(readings.keypoints.points_px, TRUE_PX[:-1])
    np.testing.assert_allclose(readings.pose.t_body_cam_m, T_BODY_CAM_M, atol=1e-3)


@pytest.mark.parametrize(("least_trust", "read"), [(0.0, True), (0.999999, False)])
def test_places_whose_pose_is_not_trusted_are_ignored(least_trust, read):
    """Their standard deviations are a twentieth of the box, which a net of one place could not have."""
    config = MeasurementConfig(least_trust=least_trust)
    readings = NetEye(config, CRAFT, CAMERA, 0, FindsPlaces(5.0)).read(labels(), IMAGE, Q)
    assert (readings.keypoints is not None) == read


class Errs:
    """Finds keypoints with an error of its own that is the same in every image of nearly one view."""

    ERROR_PX = np.random.default_rng(9).normal(0, 3.0, (12, 2))

    def __init__(self):
        self.true_px = {}

    def detect(self, image):
        px = self.true_px[id(image)] + self.ERROR_PX
        return [posse.Detection("box", 0.9, np.array([200.0, 150.0, 100.0, 80.0]), px, np.ones(12))]


def expected_frame(R, t):
    craft = SimpleNamespace(R_cam_from_body=R, t_body_cam_m=t)
    image = np.ones((384, 512), np.uint8)
    return SimpleNamespace(state=SimpleNamespace(craft=craft), labels=labels(), image=image)


def test_the_error_in_the_expected_image_is_taken_off():
    """The expected pose is another than the true one; its own projections are not what is read."""
    nets = Errs()
    R, t = cv2.Rodrigues(np.array([0.42, -0.88, 0.21]))[0], np.add(T_BODY_CAM_M, [0.2, 0.1, -0.5])
    expected = expected_frame(R, t)
    nets.true_px[id(IMAGE)] = TRUE_PX
    nets.true_px[id(expected.image)] = cv2.projectPoints(POINTS_BODY_M, R, t, CAMERA.matrix, None)[0][
        :, 0
    ]
    eye = NetEye(MeasurementConfig(sigma_px=0.5, largest_sigma=0.1), CRAFT, CAMERA, 0, nets)
    plain = eye.read(labels(), IMAGE, Q)
    np.testing.assert_allclose(plain.keypoints.points_px, TRUE_PX + Errs.ERROR_PX)
    corrected = eye.read(labels(), IMAGE, Q, Expected(frame=expected))
    np.testing.assert_allclose(corrected.keypoints.points_px, TRUE_PX, atol=1e-9)
    np.testing.assert_allclose(corrected.pose.t_body_cam_m, T_BODY_CAM_M, atol=1e-4)
    np.testing.assert_array_equal(corrected.pose_alone.t_body_cam_m, plain.pose.t_body_cam_m)


def test_without_a_detection_in_the_expected_image_nothing_is_taken_off():
    nets = Finds("box", 1.0)
    expected = expected_frame(R_CAM_FROM_BODY, T_BODY_CAM_M)
    nets.detect = lambda image: [] if image is expected.image else [nets.found]
    eye = NetEye(MeasurementConfig(largest_sigma=0.1), CRAFT, CAMERA, 0, nets)
    readings = eye.read(labels(), IMAGE, Q, Expected(frame=expected))
    np.testing.assert_array_equal(readings.keypoints.points_px, TRUE_PX)
