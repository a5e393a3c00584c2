"""A second look at a spacecraft whose box was poor."""

import itertools
from dataclasses import replace
from typing import ClassVar

import cuboid
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posse_core as posse
from posse_core._detection.looking import look, sightings_of
from posse_core._detection.shapes import Shapes
from posse_core._evaluation.metrics import box_iou

R, T = Rotation.from_rotvec([0.4, -0.3, 0.2]).as_matrix(), np.array([0.3, -0.2, 9.0])
CORNERS = cuboid.corners()
IMAGE = np.zeros((cuboid.CAMERA.height_px, cuboid.CAMERA.width_px), np.uint8)
SHAPES = Shapes({"brick": cuboid.cuboid()})
TRUE_PX = SHAPES.box_px(
    "brick", posse.PoseEstimate(R, T, np.eye(6), np.ones(8, bool), 1.0), cuboid.CAMERA
)


class Sees(posse.KeypointFinder):
    """Knows the keypoints in a good box, as well as it says, and less well in a poor one."""

    classes = ("brick",)
    keypoints_body_m: ClassVar = {"brick": CORNERS}

    def __init__(self, good_sigma_px=0.3, poor_sigma_px=4.0):
        self.looks, self.good_sigma_px, self.poor_sigma_px = [], good_sigma_px, poor_sigma_px

    def load(self, path):
        raise NotImplementedError  # it knows without a file

    def find(self, image, detections):
        (detection,) = detections
        self.looks.append(detection.box_px)
        true = cuboid.CAMERA.project(CORNERS @ R.T + T)
        if float(box_iou(detection.box_px, TRUE_PX)) > 0.8:
            sigma_px = np.full(8, self.good_sigma_px)
            return [replace(detection, keypoints_px=true, keypoints_sigma_px=sigma_px)]
        off_px = np.random.default_rng(1).normal(0, 1.0, (8, 2))
        sigma_px = np.full(8, self.poor_sigma_px)
        return [replace(detection, keypoints_px=true + off_px, keypoints_sigma_px=sigma_px)]


def nothing():
    return []


def poor():
    return posse.Detection("brick", 0.9, TRUE_PX + np.array([-20.0, -12.0, 34.0, 30.0]))


def test_a_poor_box_is_told_by_the_pose_and_mended():
    finder = Sees()
    found, (pose,) = look(finder, IMAGE, poor(), cuboid.CAMERA, SHAPES)
    assert len(finder.looks) == 2
    assert float(box_iou(found.box_px, TRUE_PX)) > 0.8
    np.testing.assert_allclose(pose.t_body_cam_m, T, atol=1e-6)
    np.testing.assert_allclose(pose.R_cam_from_body, R, atol=1e-6)


@pytest.mark.parametrize("shapes", [None, Shapes({})])
def test_without_a_mesh_wider_boxes_are_looked_at_but_not_followed(shapes):
    finder = Sees()
    _, (pose,) = look(finder, IMAGE, poor(), cuboid.CAMERA, shapes)
    assert len(finder.looks) == 3
    first, *wider = np.array(finder.looks)
    np.testing.assert_array_equal(first, poor().box_px)
    for box in wider:
        np.testing.assert_allclose(box[:2] + box[2:] / 2, first[:2] + first[2:] / 2)
        assert box[2] / first[2] == pytest.approx(box[3] / first[3])
        assert box[2] > 1.5 * first[2]
    assert pose.t_body_cam_m != pytest.approx(T, abs=1e-3)


def test_a_good_box_needs_no_second_look():
    finder = Sees()
    good = posse.Detection("brick", 0.9, TRUE_PX + np.array([1.0, 0.0, -1.0, 1.0]))
    look(finder, IMAGE, good, cuboid.CAMERA, SHAPES)
    assert len(finder.looks) == 1


def test_looks_that_are_less_certain_do_not_count():
    finder = Sees(good_sigma_px=40.0)
    found, (pose,) = look(finder, IMAGE, poor(), cuboid.CAMERA, SHAPES)
    middles_px = [box[:2] + box[2:] / 2 for box in (found.box_px, poor().box_px)]
    np.testing.assert_allclose(*middles_px)  # of the detection's box, or one that is wider
    assert pose.t_body_cam_m != pytest.approx(T, abs=1e-3)


class Blinkered(Sees):
    """Sees nothing but what is in the square around a box."""

    def find(self, image, detections):
        (detection,) = detections
        square = posse.Square.around(detection.box_px, 192)
        into = square.points_in(cuboid.CAMERA.project(CORNERS @ R.T + T))
        if np.all((into > 0) & (into < 191)):
            return super().find(image, [replace(detection, box_px=TRUE_PX)])
        squeezed = square.points_out(np.clip(into, 0, 191))
        return [replace(detection, keypoints_px=squeezed, keypoints_sigma_px=np.full(8, 6.0))]


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_box_around_a_part_of_the_spacecraft_is_widened(corner):
    """Half of it, as if the Sun lit that part alone."""
    half_px = TRUE_PX[2:] / 2
    part_px = np.concatenate([TRUE_PX[:2] + corner * half_px, half_px])
    _, poses = look(Blinkered(), IMAGE, posse.Detection("brick", 0.9, part_px), cuboid.CAMERA, SHAPES)
    np.testing.assert_allclose(poses[0].t_body_cam_m, T, atol=1e-5)
    np.testing.assert_allclose(poses[0].R_cam_from_body, R, atol=1e-5)
    assert all(one.trust >= other.trust for one, other in itertools.pairwise(poses))


ELSEWHERE_PX = np.array([2.0, 2.0, 30.0, 30.0])


class Confused(Sees):
    """Sees a spacecraft in a good box, and anything in any other."""

    def find(self, image, detections):
        (detection,) = detections
        if float(box_iou(detection.box_px, TRUE_PX)) > 0.1:
            return super().find(image, detections)
        anywhere = np.random.default_rng(2).uniform(0, 40, (8, 2))
        return [replace(detection, keypoints_px=anywhere, keypoints_sigma_px=np.full(8, 20.0))]


def test_a_trusted_pose_comes_first_and_makes_up_for_a_low_score():
    boxes = [
        posse.Detection("brick", 0.8, ELSEWHERE_PX),
        posse.Detection("brick", 0.15, TRUE_PX.astype(float)),
        posse.Detection("brick", 0.12, ELSEWHERE_PX + 40),
        posse.Detection("brick", 0.05, ELSEWHERE_PX + 80),
    ]
    given = Confused(), IMAGE, cuboid.CAMERA, None, 0.3, None, nothing
    found, dropped = sightings_of(boxes, *given)
    assert [each.detection.score for each in found] == [0.15, 0.8]
    assert found[0].pose.trust > 0.99
    assert sorted(each.score for each in dropped) == [0.05, 0.12]


@pytest.mark.parametrize(
    ("sigma_px", "score", "expected"),
    [
        ((0.3, 4.0), 0.15, [0.15, 0.8]),  # trusted
        ((3.0, 4.0), 0.15, [0.15, 0.8]),  # the likeliest, by a sixth
        ((40.0, 40.0), 0.9, [0.8]),
    ],
)
def test_a_closer_search_counts_where_its_pose_is_trusted_or_likeliest(sigma_px, score, expected):
    boxes = [posse.Detection("brick", 0.8, ELSEWHERE_PX)]
    closer = [
        posse.Detection("brick", score, TRUE_PX + 1.0),
        posse.Detection("brick", 0.7, ELSEWHERE_PX + 1),
    ]
    given = Confused(*sigma_px), IMAGE, cuboid.CAMERA, None, 0.3, None, lambda: closer
    found, dropped = sightings_of(boxes, *given)
    assert [each.detection.score for each in found] == expected
    assert dropped == []


class Certain(posse.Refiner):
    """Makes each pose as certain as it is told, whatever it is."""

    certainty = 0.0
    starts: ClassVar[list[posse.PoseEstimate]] = []

    def open(self, setting):
        pass

    def close(self):
        pass

    def refine(self, image, starts, sun_direction_cam=None, box_px=None):
        self.starts.append(starts[0])
        pose = replace(starts[0], covariance=np.eye(6) * 1e-8, certainty=self.certainty)
        return posse.Refinement(pose, True, 0.5, 0.9)


@pytest.mark.parametrize(
    ("certainty", "others", "expected"),
    [
        (0.4, [0.8], [0.15, 0.8]),
        (0.2, [0.8], [0.15, 0.8]),  # likelier than what is told anyway
        (0.01, [0.8], [0.8]),
        (0.4, [], [0.15]),
        (0.2, [], []),
    ],
)
def test_the_likeliest_pose_is_refined_first_and_dropped_where_that_disproves_it(
    certainty, others, expected
):
    """Of a detection whose score is too low."""
    Certain.starts.clear()
    Certain.certainty = certainty
    boxes = [
        *(posse.Detection("brick", score, ELSEWHERE_PX) for score in others),
        posse.Detection("brick", 0.15, TRUE_PX + 1.0),
    ]
    shapes = Shapes({"brick": cuboid.cuboid()}, lambda craft, camera: Certain(posse.NoOptions()))
    given = Confused(3.0), IMAGE, cuboid.CAMERA, shapes, 0.3, None, nothing
    found, dropped = sightings_of(boxes, *given)
    np.testing.assert_allclose(Certain.starts[0].R_cam_from_body, R, atol=1e-5)
    assert 0.05 < Certain.starts[0].trust < 0.5
    assert [each.detection.score for each in found] == expected
    assert len(found) + len(dropped) == len(boxes)


@pytest.mark.parametrize(("before", "is_found"), [(11, True), (12, False)])
def test_the_dozen_best_of_a_closer_search_are_looked_at(before, is_found):
    others = [posse.Detection("brick", 0.7, ELSEWHERE_PX + 30 * i) for i in range(before)]
    closer = [*others, posse.Detection("brick", 0.5, TRUE_PX + 1.0)]
    given = Confused(0.3, 40.0), IMAGE, cuboid.CAMERA, None, 0.3, None, lambda: closer
    assert bool(sightings_of([], *given)[0]) == is_found


def test_where_a_pose_is_trusted_no_closer_search_is_made():
    def closer():
        raise AssertionError

    boxes = [posse.Detection("brick", 0.8, TRUE_PX + 1.0)]
    given = Confused(), IMAGE, cuboid.CAMERA, None, 0.3, None, closer
    assert len(sightings_of(boxes, *given)[0]) == 1


class Halved(Sees):
    """Takes a part of the spacecraft for one that is twice as far, and is less sure of it."""

    def find(self, image, detections):
        (detection,) = detections
        if float(box_iou(detection.box_px, TRUE_PX)) > 0.5:
            return super().find(image, detections)
        farther = cuboid.CAMERA.project(CORNERS @ R.T + 2 * T)
        return [replace(detection, keypoints_px=farther, keypoints_sigma_px=np.full(8, 0.45))]


def test_a_part_of_a_spacecraft_that_is_seen_whole_is_dropped():
    part_px = np.concatenate([TRUE_PX[:2] + TRUE_PX[2:] / 4, TRUE_PX[2:] / 2])
    boxes = [posse.Detection("brick", 0.9, part_px), posse.Detection("brick", 0.5, TRUE_PX + 1.0)]
    (_, (far, *_)), (_, (near, *_)) = (
        look(Halved(), IMAGE, each, cuboid.CAMERA, SHAPES) for each in boxes
    )
    assert 0.5 < far.trust < near.trust
    (found,), (dropped,) = sightings_of(
        boxes, Halved(), IMAGE, cuboid.CAMERA, SHAPES, 0.3, None, nothing
    )
    assert (found.detection.score, dropped.score) == (0.5, 0.9)


class Content(posse.Refiner):
    """Leaves each pose as it is, and counts them."""

    refined = 0
    boxes_px: ClassVar[list[np.ndarray | None]] = []

    def open(self, setting):
        pass

    def close(self):
        pass

    def refine(self, image, starts, sun_direction_cam=None, box_px=None):
        type(self).refined += 1
        type(self).boxes_px.append(box_px)
        return posse.Refinement(starts[0], False, 0.9, 0.9, True)


def test_two_detections_of_one_spacecraft_count_once_and_are_refined_once():
    """Both boxes become that of the mesh at the pose."""
    boxes = [posse.Detection("brick", 0.9, poor().box_px), posse.Detection("brick", 0.6, TRUE_PX + 1.0)]
    shapes = Shapes({"brick": cuboid.cuboid()}, lambda craft, camera: Content(posse.NoOptions()))
    found, dropped = sightings_of(boxes, Sees(), IMAGE, cuboid.CAMERA, shapes, 0.3, None, nothing)
    assert [each.detection.score for each in found] == [0.9]
    assert [each.score for each in dropped] == [0.6]
    assert Content.refined == 1


def test_a_refiner_is_told_the_box_that_the_detector_saw():
    """And not that of the mesh at a first pose, around which keypoints were found again."""
    Content.boxes_px.clear()
    shapes = Shapes({"brick": cuboid.cuboid()}, lambda craft, camera: Content(posse.NoOptions()))
    (found,), _ = sightings_of([poor()], Sees(), IMAGE, cuboid.CAMERA, shapes, 0.3, None, nothing)
    np.testing.assert_array_equal(Content.boxes_px, [poor().box_px])
    assert found.start is not None
    assert found.start.detection is not None
    assert not np.array_equal(found.start.detection.box_px, poor().box_px)
