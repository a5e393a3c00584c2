"""Functions that the tests use to measure triangle meshes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh


@pytest.fixture(scope="session")
def solid():
    """Returns a function that makes a trimesh with vertices merged by position, to check that it is
    closed."""

    def make(vertices, faces):
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        mesh.merge_vertices(merge_norm=True, merge_tex=True)
        return mesh

    return make


@pytest.fixture(scope="session")
def face_normals():
    """Returns a function that computes the (T, 3) unit normals of triangles by the right-hand rule."""

    def measure(vertices, faces):
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        cross = np.cross(b - a, c - a)
        return cross / np.linalg.norm(cross, axis=1, keepdims=True)

    return measure


@pytest.fixture(scope="session")
def distance_to_surface(face_normals):
    """Returns a function that computes the distance of a point from the nearest point of all triangles,
    inside them or on their edges."""

    def measure(vertices, faces, point):
        corners = np.moveaxis(vertices[faces], 1, 0)
        normal = face_normals(vertices, faces)
        height = ((point - corners[0]) * normal).sum(axis=1)
        foot = point - height[:, None] * normal
        inside = np.ones(len(faces), dtype=bool)
        best = np.inf
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            along = end - start
            inside &= (np.cross(along, foot - start) * normal).sum(axis=1) >= 0.0
            t = np.clip(((point - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
            best = min(best, np.linalg.norm(start + t[:, None] * along - point, axis=1).min())
        return min(best, np.abs(height[inside]).min(initial=np.inf))

    return measure
