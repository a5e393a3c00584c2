"""Meshes with fewer triangles: of a sphere, whose shape is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from posse_core._model.spacecraft import Part
from posse_core._refinement.simplified import simplified

RADIUS_M = 2.0
STEP_M = RADIUS_M / 100
"""The largest step."""


def sphere(subdivisions: int) -> Part:
    mesh = trimesh.creation.icosphere(subdivisions, RADIUS_M)
    vertices = np.asarray(mesh.vertices)
    return Part(
        "sphere",
        vertices,
        np.asarray(mesh.faces, dtype=np.int32),
        (vertices / RADIUS_M).astype(np.float32),
        np.zeros((len(vertices), 2), np.float32),
        "paint",
    )


def area_m2(part: Part) -> float:
    a, b, c = np.moveaxis(part.vertices_body_m[part.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_mesh_of_few_triangles_stays_as_it_is():
    part = sphere(4)
    assert simplified([part], RADIUS_M) == (part,)


def test_a_sphere_of_many_triangles_keeps_its_shape_with_fewer():
    part = sphere(8)
    (made,) = simplified([part], RADIUS_M)
    assert len(part.faces) == 1_310_720
    assert len(made.faces) < 0.4 * len(part.faces)
    # A vertex moves within its cell.
    radii_m = np.linalg.norm(made.vertices_body_m, axis=1)
    np.testing.assert_allclose(radii_m, RADIUS_M, atol=STEP_M)
    assert area_m2(made) == pytest.approx(4 * np.pi * RADIUS_M**2, rel=0.01)
    radial = made.vertices_body_m / radii_m[:, None]
    assert (radial * made.normals_body).sum(axis=1).min() > 0.9999
    assert len(np.unique(np.sort(made.faces, axis=1), axis=0)) == len(made.faces)


def test_what_is_smaller_than_a_cell_is_left_out():
    small = sphere(1)
    dust = Part(
        "dust",
        small.vertices_body_m * 1e-4 + 0.3 * STEP_M,
        small.faces,
        small.normals_body,
        small.uv,
        "paint",
    )
    made = simplified([sphere(7), dust], RADIUS_M)
    assert [part.name for part in made] == ["sphere"]
