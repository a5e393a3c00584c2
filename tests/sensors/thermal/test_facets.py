"""Facets: their division, what they see, and what is behind them."""

import numpy as np
import pytest
import trimesh
from thermal_bodies import box, craft, model, plate

from posse_core import Part
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles
from posse_core._sensors.thermal.facets import Facets
from posse_core.testing import scenes


def part_of(name: str, mesh: trimesh.Trimesh) -> Part:
    count = len(mesh.vertices)
    return Part(
        name,
        np.array(mesh.vertices, dtype=np.float64),
        np.array(mesh.faces, dtype=np.int32),
        np.array(mesh.vertex_normals, dtype=np.float32),
        np.zeros((count, 2), dtype=np.float32),
        "plain",
    )


def facets_of(*parts: Part, size_m: float = 100.0) -> Facets:
    return Facets.of(Tracer(Triangles.of(craft(*parts))), size_m)


def test_facets_cover_the_surface_and_none_is_too_long():
    facets = facets_of(box("box", (1.0, 2.0, 0.1)), size_m=0.3)
    assert facets.area_m2.sum() == pytest.approx(8 * (1 * 2 + 1 * 0.1 + 2 * 0.1), rel=1e-12)
    corners_m = facets.bisection.leaf_corners_m
    assert np.linalg.norm(corners_m - np.roll(corners_m, 1, axis=1), axis=2).max() <= 0.3


def test_a_rod_is_not_divided_into_thousands():
    """5 m by 2 cm and 1 cm, and facets of 30 cm."""
    assert 50 < facets_of(box("rod", (2.5, 0.01, 0.005)), size_m=0.3).count < 500


def test_a_point_is_on_the_facet_that_contains_it():
    facets = facets_of(box("box", (1.0, 2.0, 0.1)), size_m=0.3)
    rng = np.random.default_rng(2)
    triangle = rng.integers(0, 12, 5000)
    shares = rng.dirichlet([1, 1, 1], 5000)
    point_m = np.einsum("kc,kci->ik", shares, facets.triangles.corners_m[triangle])
    found = facets.bisection.at(triangle, point_m)
    np.testing.assert_array_equal(facets.triangle[found], triangle)
    inside = trimesh.triangles.points_to_barycentric(facets.bisection.leaf_corners_m[found], point_m.T)
    assert inside.min() > -1e-9


def test_rays_to_points_of_every_side_find_their_triangles_by_the_faces():
    """A face without area is counted among the faces, and is no triangle."""
    solid = box("box", (1.0, 1.0, 1.0))
    faces = np.insert(solid.faces, 3, [0, 0, 1], axis=0)
    flawed = Part("box", solid.vertices_body_m, faces, solid.normals_body, solid.uv, "plain")
    facets = facets_of(flawed)
    np.testing.assert_array_equal(facets.triangle_of_face, [0, 1, 2, -1, *range(3, 12)])


def test_a_convex_body_sees_the_sky_alone_and_its_inside_none_of_it():
    facets = facets_of(part_of("ball", trimesh.creation.icosphere(2)))
    np.testing.assert_array_equal(facets.openness, np.repeat([1.0, 0.0], facets.count))


@pytest.mark.parametrize("height_m", [0.3, 1.0, 3.0])
def test_openness_under_a_disc_is_its_view_factor(height_m: float):
    """From a small plate to a parallel disc of radius R above it: R²/(h² + R²) (Howell, B-12)."""
    angle = np.linspace(0, 2 * np.pi, 181)[:-1]
    rim = np.stack([np.cos(angle), np.sin(angle), np.full(180, height_m)], axis=1)
    vertices = np.vstack([rim, [0, 0, height_m]])
    faces = np.stack([np.arange(180), np.roll(np.arange(180), -1), np.full(180, 180)], axis=1)
    none = np.zeros((181, 3), dtype=np.float32)
    disc = Part("disc", vertices, faces.astype(np.int32), none, none[:, :2], "plain")
    facets = facets_of(plate(0.001), disc)
    hidden = 1 - facets.openness[:2]
    np.testing.assert_allclose(hidden, 1 / (height_m**2 + 1), atol=0.02)


def test_a_thin_panel_radiates_through_its_other_face():
    facets = facets_of(box("panel", (1.0, 1.0, 0.01)), size_m=0.25)
    behind = facets.behind(thin_m=0.05)
    broad = np.abs(facets.normal[2]) > 0.5
    other = behind[broad]
    assert np.all((other >= 0) & (other < facets.count))
    # Straight through the panel, within a facet, on the other face of the same part.
    away_m = facets.centre_m[:, other] - facets.centre_m[:, broad]
    np.testing.assert_allclose(np.abs(away_m[2]), 0.02, rtol=1e-9)
    assert np.all(np.hypot(*away_m[:2]) < 0.25)
    assert np.all(facets.normal[2, other] == -facets.normal[2, broad])


def test_a_thick_body_is_insulated_and_a_sheet_radiates_from_its_back():
    assert np.all(facets_of(box("bus", (1.0, 1.0, 1.0))).behind(thin_m=0.05) == -1)
    sheet = facets_of(plate())
    np.testing.assert_array_equal(sheet.behind(thin_m=0.05), [2, 3])


def test_a_thin_gap_between_two_parts_is_no_wall():
    lower = box("lower", (1.0, 1.0, 0.5))
    upper = box("upper", (1.0, 1.0, 0.5), centre_m=(0.0, 0.0, 1.01))
    assert np.all(facets_of(lower, upper).behind(thin_m=0.05) == -1)


def test_the_sun_shines_on_the_near_sides_and_shadows_fall():
    """A roof over half of a floor, and the Sun above."""
    floor = scenes.rectangle("floor", "plain", u_m=(2.0, 0.0, 0.0), v_m=(0.0, 1.0, 0.0))
    roof = scenes.rectangle(
        "roof", "plain", centre_m=(-1.0, 0.0, 1.0), u_m=(1.0, 0.0, 0.0), v_m=(0.0, 1.0, 0.0)
    )
    facets = facets_of(floor, roof, size_m=0.1)
    lit = facets.lit(np.array([0.0, 0.0, 1.0]))[: facets.count]
    on_roof = facets.part_id == 1
    x_m = facets.bisection.leaf_corners_m[:, :, 0] + facets.triangles.centre_body_m[0]
    np.testing.assert_array_equal(lit[on_roof | (x_m.min(axis=1) > 0)], 1)
    np.testing.assert_array_equal(lit[~on_roof & (x_m.max(axis=1) < 0)], 0)
    assert np.sum((lit * facets.area_m2)[~on_roof]) == pytest.approx(4.0, rel=0.01)
    assert not facets.lit(np.array([0.0, 0.0, 1.0]))[facets.count :].any()


def test_a_facet_on_the_edge_of_a_shadow_is_lit_by_its_share():
    """Shadow's edges at many places: the shares are right on average, and each to a half."""
    errors = []
    for edge_m in np.linspace(-0.4, 0.4, 41):
        roof = scenes.rectangle(
            "roof", "plain", centre_m=(edge_m - 3.0, 0.0, 1.0), u_m=(3.0, 0.0, 0.0), v_m=(0.0, 3.0, 0.0)
        )
        facets = facets_of(plate(), roof)
        lit = facets.lit(np.array([0.0, 0.0, 1.0]))
        errors.append(np.sum(lit[:2] * facets.area_m2[:2]) - (0.5 - edge_m))
    assert abs(np.mean(errors)) < 0.01
    assert np.max(np.abs(errors)) < 0.2


def test_kept_shadows_are_those_of_a_direction_nearby():
    facets = model(box("box", (1.0, 1.0, 1.0))).facets
    rng = np.random.default_rng(3)
    for direction in rng.normal(size=(50, 3)):
        direction /= np.linalg.norm(direction)
        # Away from the edge between light and dark, both say the same.
        clear = np.abs(direction @ facets.normal) > np.sin(np.radians(0.9))
        clear = np.tile(clear, 2)
        np.testing.assert_array_equal(facets.lit_about(direction)[clear], facets.lit(direction)[clear])
