"""Corners of triangles that are one vertex."""

from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from posse_core._spacecraft.corners import shared
from posse_core._spacecraft.raw import raw_part


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40), kinds=st.integers(1, 6))
def test_triangles_keep_their_corners_and_no_vertex_is_there_twice(seed, count, kinds):
    rng = np.random.default_rng(seed)
    places, normals, uv = (rng.normal(size=(kinds, n)) for n in (3, 3, 2))
    pick = rng.integers(kinds, size=(3, 3 * count))
    corners = places[pick[0]], normals[pick[1]], uv[pick[2]]
    kept, faces = shared(*corners)
    for each in corners:
        np.testing.assert_array_equal(each[kept][faces.reshape(-1)], each)
    rows = np.column_stack([each[kept] for each in corners])
    assert len(np.unique(rows, axis=0)) == len(rows)
    assert (np.diff(kept) > 0).all()


def test_a_box_without_normals_has_four_vertices_a_side():
    box = trimesh.creation.box((1, 2, 3))
    soup = box.vertices[box.faces].reshape(-1, 3)
    part = raw_part("box", soup, np.arange(36).reshape(-1, 3), None, None, "paint")
    assert part.vertices.shape == (24, 3)
    np.testing.assert_array_equal(part.vertices[part.faces], box.vertices[box.faces])
    flat = np.cross(*(np.diff(part.vertices[part.faces], axis=1)[:, k] for k in (0, 1)))
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(part.normals[part.faces], flat[:, None].repeat(3, axis=1), atol=1e-6)


def test_a_smooth_surface_without_normals_shares_all_of_its_vertices():
    ball = trimesh.creation.icosphere(3)
    soup = ball.vertices[ball.faces].reshape(-1, 3)
    part = raw_part("ball", soup, np.arange(len(soup)).reshape(-1, 3), None, None, "paint")
    assert len(part.vertices) == len(ball.vertices)
