"""Rotations of `frames` that the attitude laws stand on, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray
from posse_core._frames import (
    R_a_from_b_by_directions,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    unit,
)

vector = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)
angle = st.one_of(st.floats(0, np.pi), st.sampled_from([0.0, 1e-300, 1e-12, 1e-6, np.pi - 1e-8, np.pi]))


@given(axis=vector, angle=angle)
def test_rotation_vectors(axis: FloatArray, angle: float) -> None:
    assume(np.linalg.norm(axis) > 1e-3)
    rotation = angle * unit(axis)
    R = matrix_from_rotation_vector(rotation)
    np.testing.assert_allclose(R, Rotation.from_rotvec(rotation).as_matrix(), atol=1e-14)
    back = rotation_vector_from_matrix(R)
    # Half a turn about an axis is half a turn about its opposite.
    np.testing.assert_allclose(matrix_from_rotation_vector(back), R, atol=1e-13)
    assert np.linalg.norm(back) == pytest.approx(angle, abs=1e-7)
    if angle < 3:
        np.testing.assert_allclose(back, rotation, atol=1e-13)


@given(first_a=vector, second_a=vector, first_b=vector, second_b=vector)
def test_two_directions(
    first_a: FloatArray, second_a: FloatArray, first_b: FloatArray, second_b: FloatArray
) -> None:
    for pair in ((first_a, second_a), (first_b, second_b)):
        assume(np.linalg.norm(np.cross(*pair)) > 1e-2)
    R = R_a_from_b_by_directions(first_a, second_a, first_b, second_b)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)
    np.testing.assert_allclose(R @ unit(first_b), unit(first_a), atol=1e-13)
    # The second pair lies on one side of the first, in one plane.
    side = np.cross(R @ first_b, R @ second_b)
    np.testing.assert_allclose(unit(side), unit(np.cross(first_a, second_a)), atol=1e-10)


def test_parallel_directions_leave_the_turn_open() -> None:
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    with pytest.raises(ValueError, match="direction"):
        R_a_from_b_by_directions(x, 2 * x, x, y)
