"""Solids against closed forms, and against trimesh's check that they are closed."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from posse_core._frames import R_about
from posse_core._spacecraft import shapes

length = st.floats(0.05, 5.0)


def volume_m3(mesh):
    """The volume that trimesh computes."""
    return trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False).volume


SOLIDS = {
    "box": shapes.box((1.0, 2.0, 3.0)),
    "panel": shapes.panel(4.0, 1.0, 0.03),
    "prism": shapes.prism([(0, 0), (2, 0), (2, 1), (1, 2), (0, 1)], 0.5),
    "hood": shapes.hood((1.0, 2.0, 3.0), 0.1),
    "cylinder": shapes.cylinder(1.0, 2.0),
    "frustum": shapes.frustum(1.0, 0.5, 2.0),
    "cone": shapes.revolved([(0, 0), (1, 0), (0, 2)], 16),
    "ring": shapes.ring(0.5, 1.0, 2.0),
    "nozzle": shapes.nozzle(0.1, 0.4, 0.5, 0.02),
    "tube": shapes.tube([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1.5, 1.5, 2)], 0.05),
    "dish": shapes.dish(1.6, 0.9, offset_m=0.8),
    "curved_panel": shapes.curved_panel(1.45, 0.4, 0.8, 0.03, 8),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_every_solid_is_closed_and_its_faces_point_outward(name, solid):
    mesh = SOLIDS[name]
    merged = solid(mesh.vertices_m, mesh.faces)
    assert merged.is_watertight
    assert merged.is_winding_consistent
    assert merged.volume > 0.0


@pytest.mark.parametrize("name", SOLIDS)
def test_shading_normals_are_unit_and_follow_the_faces(name, face_normals):
    mesh = SOLIDS[name]
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
    agreement = (face_normals(mesh.vertices_m, mesh.faces)[:, None] * mesh.normals[mesh.faces]).sum(-1)
    assert agreement.min() > 0.94  # half a facet of the coarsest round solid is 18°


@pytest.mark.parametrize("name", SOLIDS)
def test_textures_are_not_mirrored(name):
    """Text on a face is readable from outside."""
    mesh = SOLIDS[name]
    a, b, c = np.moveaxis(mesh.uv[mesh.faces].astype(np.float64), 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    assert (ux * vy - uy * vx > 0.0).all()


@given(x=length, y=length, z=length)
def test_a_box_has_its_volume_and_area(x, y, z):
    mesh = shapes.box((x, y, z))
    assert volume_m3(mesh) == pytest.approx(x * y * z)
    assert trimesh.Trimesh(mesh.vertices_m, mesh.faces).area == pytest.approx(
        2.0 * (x * y + y * z + z * x)
    )
    np.testing.assert_allclose(np.ptp(mesh.vertices_m, axis=0), (x, y, z))


@given(bottom=length, top=length, height=length, segments=st.integers(3, 200))
def test_a_frustum_has_the_volume_of_the_pyramid_inscribed_in_the_cone(bottom, top, height, segments):
    polygon = (
        0.5 * segments * np.sin(2.0 * np.pi / segments)
    )  # area of the polygon inscribed in the unit circle
    exact = polygon * height * (bottom**2 + bottom * top + top**2) / 3.0
    assert volume_m3(shapes.frustum(bottom, top, height, segments)) == pytest.approx(exact)


def test_round_solids_converge_to_the_exact_volume():
    assert volume_m3(shapes.cylinder(0.7, 2.0, 4000)) == pytest.approx(np.pi * 0.49 * 2.0, rel=1e-5)
    wall = np.pi * (0.5**2 - 0.4**2) * 0.3
    assert volume_m3(shapes.ring(0.4, 0.5, 0.3, 4000)) == pytest.approx(wall, rel=1e-5)
    bent = 0.5 * 0.8 * (1.45**2 - 1.42**2) * 0.4
    assert volume_m3(shapes.curved_panel(1.45, 0.4, 0.8, 0.03, 800)) == pytest.approx(bent, rel=1e-5)


def test_a_hood_has_the_volume_of_a_box_minus_its_cavity():
    mesh = shapes.hood((1.0, 2.0, 3.0), 0.1)
    assert volume_m3(mesh) == pytest.approx(1.0 * 2.0 * 3.0 - 0.8 * 1.8 * 2.9)


@given(corner=st.tuples(*[st.floats(-1.0, 1.0)] * 3), radius=st.floats(0.01, 0.05))
def test_a_bent_rod_has_the_volume_of_its_legs(corner, radius):
    """A mitre adds as much volume on the outside of the bend as it removes on the inside."""
    path = np.array([(-2.0, 0.0, 0.0), corner, (0.0, 2.5, 1.0)])
    legs = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    segments = 12
    area = 0.5 * segments * np.sin(2.0 * np.pi / segments) * radius**2
    assert volume_m3(shapes.tube(path, radius, segments)) == pytest.approx(area * legs, rel=1e-9)


@given(focal=st.floats(0.4, 3.0), offset=st.floats(0.0, 1.5))
def test_a_dish_reflects_rays_along_its_axis_to_the_focus(focal, offset):
    mesh = shapes.dish(1.6, focal, offset)
    front = mesh.normals[:, 2] > 0.1
    points, normals = mesh.vertices_m[front], mesh.normals[front].astype(np.float64)
    incoming = np.array([0.0, 0.0, -1.0])
    reflected = incoming - 2.0 * (normals @ incoming)[:, None] * normals
    focus = np.array([-offset, 0.0, focal - offset**2 / (4.0 * focal)])
    to_focus = focus - points
    miss = np.linalg.norm(np.cross(reflected, to_focus), axis=1)
    assert miss.max() < 1e-5


def test_moving_a_mesh_keeps_its_volume_and_rotates_its_normals():
    R = R_about((1.0, 2.0, 3.0), 0.7)
    moved = SOLIDS["box"].at((1.0, -2.0, 0.5), R)
    assert volume_m3(moved) == pytest.approx(6.0)
    np.testing.assert_allclose(moved.normals, SOLIDS["box"].normals @ R.T, atol=1e-6)
    np.testing.assert_allclose(moved.vertices_m.mean(axis=0), (1.0, -2.0, 0.5), atol=1e-12)
