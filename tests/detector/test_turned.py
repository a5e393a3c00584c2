"""Keypoints of turned images come back to where they are, and errors that do not turn cancel."""

from dataclasses import replace
from typing import ClassVar

import cuboid
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posse_core as posse
from posse_core._detection.card import ModelCard
from posse_core._detection.looking import look
from posse_core._detection.turned import seen_turned

R, T = Rotation.from_rotvec([0.4, -0.3, 0.2]).as_matrix(), np.array([0.3, -0.2, 9.0])
CORNERS = cuboid.corners()
CAMERA = cuboid.CAMERA
CORNERS_PX = CAMERA.project(CORNERS @ R.T + T)


def places(points_px, sigma_px):
    """One place of each keypoint."""
    shape = len(points_px), 1
    return posse.KeypointPlaces(points_px[:, None], np.full(shape, sigma_px), np.full(shape, 0.9))


class Finder(posse.KeypointFinder):
    """Knows the corners of a brick without a file."""

    classes = ("brick",)
    keypoints_body_m: ClassVar = {"brick": CORNERS}

    def load(self, path):
        """There is none."""


class Reads(Finder):
    """Finds keypoint number n at the pixel of value n + 1, if that is in the box."""

    knows_any_roll = True

    def __init__(self):
        self.shapes = []

    def find(self, image, detections):
        (detection,) = detections
        self.shapes.append(image.shape)
        x, y, width, height = detection.box_px
        assert [x, y, width, height] == [round(float(side)) for side in detection.box_px]
        inside = np.zeros_like(image)
        rows, columns = slice(int(y), int(y + height)), slice(int(x), int(x + width))
        inside[rows, columns] = image[rows, columns]
        assert np.count_nonzero(inside) == inside[rows, columns].size, "the box is beside what is seen"
        found = [np.argwhere(inside == number + 1)[0][::-1] for number in range(len(CORNERS))]
        return [detection.with_places(places(np.array(found, float), 1.0))]


def test_keypoints_of_a_turned_image_are_told_where_they_are_in_the_image_as_it_is():
    image = np.zeros((90, 141), np.uint8)
    image[20:50, 30:100] = 200
    pixels = np.random.default_rng(3).choice(30 * 70, len(CORNERS), replace=False)
    for number, (row, column) in enumerate(zip(*np.unravel_index(pixels, (30, 70)), strict=True)):
        image[20 + row, 30 + column] = number + 1
    finder = Reads()
    (first,) = finder.find(image, [posse.Detection("brick", 0.9, np.array([30.0, 20.0, 70.0, 30.0]))])
    turned = seen_turned(finder, image, first)
    assert finder.shapes == [(90, 141), (141, 90), (90, 141), (141, 90)]
    np.testing.assert_array_equal(turned.box_px, first.box_px)
    for quarter in range(4):
        np.testing.assert_array_equal(turned.places.points_px[:, quarter], first.places.points_px[:, 0])
    np.testing.assert_allclose(turned.places.share.sum(axis=1), 0.9)


class Drawn(Finder):
    """Finds each corner, to the right of where it is in the image that it is shown."""

    off_px = np.array([3.0, 0.0])

    def __init__(self, knows_any_roll, sigma_px):
        self.knows_any_roll, self.sigma_px, self.looks = knows_any_roll, sigma_px, 0

    def find(self, image, detections):
        (detection,) = detections
        self.looks += 1
        # One image is turned to the other so that the same pixel is bright.
        quarters = next(k for k in range(4) if np.array_equal(np.rot90(IMAGE, k), image))
        shown = np.zeros((len(CORNERS), 2))
        for number, (u, v) in enumerate(CORNERS_PX):
            width_px, height_px = CAMERA.width_px, CAMERA.height_px
            for _ in range(quarters):
                u, v = v, width_px - 1 - u
                width_px, height_px = height_px, width_px
            shown[number] = u, v
        wider = detection.box_px[2:].max() / BOX_PX[2:].max()
        return [detection.with_places(places(shown + self.off_px, self.sigma_px * wider))]


IMAGE = np.zeros((CAMERA.height_px, CAMERA.width_px), np.uint8)
IMAGE[3, 7] = 255
BOX_PX = np.array([*CORNERS_PX.min(axis=0), *np.ptp(CORNERS_PX, axis=0)])


@pytest.mark.parametrize(
    ("knows_any_roll", "sigma_px", "looks"),
    [
        (True, 4.0, 6),  # four, and two of wider squares, which are as unsure
        (False, 4.0, 3),
        (True, 0.1, 1),  # a sure pose is not looked at again
    ],
)
def test_an_unsure_pose_is_looked_at_in_turned_images(knows_any_roll, sigma_px, looks):
    finder = Drawn(knows_any_roll, sigma_px)
    _, (pose, *_) = look(finder, IMAGE, posse.Detection("brick", 0.9, BOX_PX), CAMERA, None)
    assert finder.looks == looks
    off_px = (CAMERA.project(pose.t_body_cam_m) - CAMERA.project(T))[0]
    assert abs(off_px) < 0.3 if looks == 6 else off_px > 2.5


def test_a_finder_that_tells_no_places_is_not_asked_again():
    class Sole(Drawn):
        def find(self, image, detections):
            return [replace(found, places=None) for found in super().find(image, detections)]

    finder = Sole(True, 4.0)
    (found,) = finder.find(IMAGE, [posse.Detection("brick", 0.9, BOX_PX)])
    assert seen_turned(finder, IMAGE, found) is None
    assert finder.looks == 1


@pytest.mark.parametrize(
    ("options", "known"),
    [
        ({"augment": True, "turn": True}, True),
        ({"augment": True, "turn": False}, False),
        ({"augment": False, "turn": True}, False),
        ({}, False),
    ],
)
def test_a_card_tells_whether_pictures_were_turned_in_training(options, known):
    card = ModelCard("heatmap", "keypoints", ("brick",), 64, "", "", "", options=options)
    assert card.knows_any_roll is known
