"""Squares of images: coordinates go there and back, and meet what the picture shows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._detection.square import Square
from posse_core._errors import InputError
from posse_core._imaging.grey import to_grey

squares = st.builds(
    Square, st.integers(-50, 50), st.integers(-50, 50), st.integers(10, 300), st.integers(8, 400)
)
numbers = st.floats(-1e3, 1e3)


@given(squares, st.tuples(*[numbers] * 4))
def test_there_and_back(square, box):
    np.testing.assert_allclose(square.boxes_out(square.boxes_in(np.array(box))), box, atol=1e-9)
    np.testing.assert_allclose(
        square.points_out(square.points_in(np.array(box[:2]))), box[:2], atol=1e-9
    )


@pytest.mark.parametrize("scale", [0.25, 1, 2])
def test_a_rectangle_is_where_its_box_says(scale):
    image = np.zeros((96, 128), np.float32)
    image[24:56, 40:88] = 1  # multiples of 8, so that shrinking keeps the edges sharp
    square = Square(-8, 16, 112, round(112 * scale))
    x, y, width, height = square.boxes_in(np.array([40.0, 24, 48, 32]))
    picture = square.cut(image)
    ys, xs = np.nonzero(picture > 0.5)
    assert (xs.min(), ys.min()) == (round(x), round(y))
    assert (xs.max() + 1, ys.max() + 1) == (round(x + width), round(y + height))
    middle = square.points_in(np.array([63.5, 39.5]))  # the rectangle's middle, in pixel centres
    weights = picture.astype(float) / picture.sum()
    v, u = np.indices(picture.shape)
    np.testing.assert_allclose([(u * weights).sum(), (v * weights).sum()], middle, atol=1e-4)


@given(st.integers(1, 300), st.integers(1, 300))
def test_the_whole_image_is_inside(height, width):
    square = Square.of_image(height, width, 64)
    assert square.side_px == max(height, width)
    assert 0 <= -square.x_px <= square.side_px - width
    assert 0 <= -square.y_px <= square.side_px - height


@given(st.tuples(numbers, numbers, st.floats(0.5, 500), st.floats(0.5, 500)))
def test_the_box_is_inside_its_square(box):
    square = Square.around(np.array(box), 64, margin=1.3)
    x, y, width, height = square.boxes_in(np.array(box))
    assert min(x, y) > 0
    assert max(x + width, y + height) < 64


def test_beyond_the_border_is_black():
    picture = Square(-10, -10, 20, 20).cut(np.ones((5, 5), np.float32))
    assert picture.sum() == pytest.approx(25)
    assert Square(100, 100, 20, 10).cut(np.ones((5, 5), np.float32)).sum() == 0


def test_grey_is_a_share_of_full_scale():
    assert to_grey(np.full((2, 2), 255, np.uint8)).max() == 1
    assert to_grey(np.full((2, 2, 3), 65535, np.uint16)) == pytest.approx(1)
    with pytest.raises(InputError, match="float64"):
        to_grey(np.zeros((2, 2)))
