"""Texture coordinates of parts without any: lengths, seams, and what stays as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._model.spacecraft import Material, Part
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.unwrapping import is_unwrapped, unwrapped

TILE_M = 0.8


def bare(solid: shapes.Mesh, R: np.ndarray) -> Part:
    """A part without texture coordinates, turned."""
    assembly = Assembly("bare")
    assembly.add("bare", "paint", solid)
    (part,) = assembly.finish({"paint": Material("paint")}, (0.0, 0.0, 0.0), []).parts
    return replace(
        part,
        vertices_body_m=part.vertices_body_m @ R.T,
        normals_body=(part.normals_body @ R.T).astype(np.float32),
        uv=np.zeros_like(part.uv),
    )


def made_of(part: Part) -> tuple[Part, np.ndarray, np.ndarray]:
    """The part with texture coordinates, and those (T, 3, 2) and the places (T, 3, 3) of its corners."""
    made = unwrapped(part, TILE_M, np.random.default_rng(1))
    return made, made.uv[made.faces].astype(float), made.vertices_body_m[made.faces]


@given(seed=st.integers(0, 2**31))
def test_shape_and_normals_stay_as_they_were(seed):
    part = bare(shapes.cylinder(0.4, 1.1), Rotation.random(random_state=seed).as_matrix())
    made, _, corners = made_of(part)
    assert not is_unwrapped(part)
    assert is_unwrapped(made)
    np.testing.assert_array_equal(corners, part.vertices_body_m[part.faces])
    np.testing.assert_array_equal(made.normals_body[made.faces], part.normals_body[part.faces])


@given(seed=st.integers(0, 2**31))
def test_lengths_in_the_texture_are_lengths_on_the_surface(seed):
    """Seen along the axis that a side faces most, a length shrinks by √3 at most."""
    part = bare(shapes.box((0.3, 0.5, 0.9)), Rotation.random(random_state=seed).as_matrix())
    _, uv, corners = made_of(part)
    flat = np.linalg.norm(np.roll(uv, -1, axis=1) - uv, axis=-1) * TILE_M
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1)
    assert (flat <= length * (1 + 1e-4)).all()
    assert (flat >= length / np.sqrt(3) * (1 - 1e-4)).all()


def test_a_box_along_its_axes_keeps_its_lengths():
    _, uv, corners = made_of(bare(shapes.box((0.3, 0.5, 0.9)), np.eye(3)))
    flat = np.linalg.norm(np.roll(uv, -1, axis=1) - uv, axis=-1) * TILE_M
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1)
    np.testing.assert_allclose(flat, length, rtol=1e-5)


@pytest.mark.parametrize(
    ("solid", "places"),
    [
        pytest.param(shapes.box((1.0, 1.0, 1.0)), 6, id="box"),
        # Two ends, and a wall that faces two axes.
        pytest.param(shapes.cylinder(0.5, 1.0), 4, id="cylinder"),
    ],
)
def test_triangles_of_a_side_are_beside_one_another_and_sides_are_apart(solid, places):
    """Each side is shifted as a whole from its place, and differently for each axis."""
    part = bare(solid, np.eye(3))
    _, uv, corners = made_of(part)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.abs(normals).argmax(axis=1)
    across = np.array([(1, 2), (2, 0), (0, 1)])[axis]
    shift = uv - np.take_along_axis(corners, across[:, None, :], axis=2) / TILE_M
    np.testing.assert_allclose(shift, shift[:, :1].repeat(3, axis=1), atol=1e-5)
    assert len(np.unique(np.round(shift[:, 0], 4), axis=0)) == places
