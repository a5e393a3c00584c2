"""An image is searched in parts where nothing is found in the whole of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import posse_core as posse
from posse_core._detection.parts import found_in_parts, parts_of

SIZES = st.integers(2, 3000)


@given(SIZES, SIZES, st.data())
def test_what_is_smaller_than_half_a_part_is_whole_in_one(
    height_px: int, width_px: int, data: st.DataObject
) -> None:
    parts = parts_of(height_px, width_px)
    side = max(parts[0].width, parts[0].height)
    width = data.draw(st.integers(1, max(1, min(side // 2, width_px))))
    height = data.draw(st.integers(1, max(1, min(side // 2, height_px))))
    x = data.draw(st.integers(0, width_px - width))
    y = data.draw(st.integers(0, height_px - height))
    assert any(
        part.x0 <= x
        and part.y0 <= y
        and x + width <= part.x0 + part.width
        and y + height <= part.y0 + part.height
        for part in parts
    )


@given(SIZES, SIZES)
def test_parts_are_within_the_image_and_half_as_long(height_px: int, width_px: int) -> None:
    for part in parts_of(height_px, width_px):
        assert 0 <= part.x0 <= width_px - part.width
        assert 0 <= part.y0 <= height_px - part.height
        assert max(part.width, part.height) == (max(height_px, width_px) + 1) // 2


class Bright(posse.Detector[posse.NoOptions]):
    """Finds what is bright, if it is at least a tenth as wide as the image that it is given."""

    classes = ("lamp",)

    def load(self, path: Path) -> None:
        raise NotImplementedError  # it knows without a file

    def predict(self, images: Sequence[np.ndarray]) -> list[list[posse.Detection]]:
        return [self._found(image) for image in images]

    def _found(self, image: np.ndarray) -> list[posse.Detection]:
        _, _, stats, _ = cv2.connectedComponentsWithStats((image > 100).astype(np.uint8))
        boxes = [stat[:4].astype(float) for stat in stats[1:] if 10 * stat[2] >= image.shape[1]]
        return [posse.Detection("lamp", min(1.0, box[2] / 100), box) for box in boxes]


@pytest.mark.parametrize(("x", "y"), [(0, 0), (310, 20), (305, 200), (599, 439), (450, 333), (150, 250)])
def test_what_is_too_small_for_the_whole_is_found_once(x: int, y: int) -> None:
    image = np.zeros((480, 640), np.uint8)
    image[y : y + 41, x : x + 41] = 200
    assert Bright(posse.NoOptions()).predict([image]) == [[]]
    (found,) = found_in_parts(Bright(posse.NoOptions()), image, {"lamp"})
    np.testing.assert_array_equal(found.box_px, [x, y, 41, 41])
    assert found_in_parts(Bright(posse.NoOptions()), image, {"aqua"}) == []


def test_two_are_found_and_the_better_comes_first() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    image[100:140, 60:100] = image[300:360, 500:560] = 200
    detector = Bright(posse.NoOptions())
    grey = image[..., 0]
    found = found_in_parts(detector, grey, {"lamp"})
    assert [each.score for each in found] == [0.6, 0.4]
    np.testing.assert_array_equal(found[0].box_px, [500, 300, 60, 60])


def test_what_is_larger_than_parts_is_not_found_in_pieces() -> None:
    image = np.zeros((480, 640), np.uint8)
    image[40:440, 40:600] = 200
    assert found_in_parts(Bright(posse.NoOptions()), image, {"lamp"}) == []
