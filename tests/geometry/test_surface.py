"""The material at points of the surface: its factors, and its textures as the renderers sample them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from posse_core._geometry.surface import Surface
from posse_core._model.camera import Camera
from posse_core._model.scene import Piece, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._model.srgb import linear_from_srgb

seeds = st.integers(0, 2**32 - 1)
NO_NORMALS = np.tile(np.array([0, 0, -1], np.float32), (4, 1))


def square(name: str, material: str, uv: np.ndarray, z_m: float = 0.0) -> Part:
    """A square from (0, 0) to (1, 1) in the plane z; its corners in the order (0, 0), (1, 0), (1, 1),
    (0, 1)."""
    corners = np.array([[0, 0, z_m], [1, 0, z_m], [1, 1, z_m], [0, 1, z_m]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Part(name, corners, faces, NO_NORMALS, uv.astype(np.float32), material)


def pieces(craft: Spacecraft) -> tuple[Piece, ...]:
    return Scene(craft, Camera(8, 8, 8.0, 8.0, 3.5, 3.5, 0.01)).pieces


UNIT_UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def on_square(xy: np.ndarray, first: int = 0, z_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) positions on a square → its triangles, of which the first has the index ``first``, and the
    points."""
    triangle = np.where(xy[:, 0] >= xy[:, 1], first, first + 1)
    return triangle, np.append(xy, np.full((len(xy), 1), z_m), axis=1)


@given(seeds)
def test_textures_are_interpolated_between_texels_and_repeat(seed):
    """Against scipy's spline of order 1 on the decoded texture, laid out three times each way."""
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 256, (5, 7, 3)).astype(np.uint8)
    both = rng.integers(0, 256, (4, 3, 2)).astype(np.uint8)
    material = Material(
        "painted",
        (0.9, 0.5, 0.2),
        0.7,
        0.6,
        0.3,
        base_color_texture=color,
        metallic_roughness_texture=both,
    )
    uv = UNIT_UV * 1.5 - 0.25
    craft = Spacecraft("c", (square("a", "painted", uv),), {"painted": material})
    xy = rng.uniform(0, 1, (300, 2))
    found = Surface(pieces(craft)).at(*on_square(xy))
    u, v = (xy * 1.5 - 0.25).T

    def expected(texture):
        tiled = np.tile(texture, (3, 3, 1))
        height, width, _ = texture.shape
        where = ((2 - v) * height - 0.5, (1 + u) * width - 0.5)
        return np.stack(
            [map_coordinates(layer, where, order=1) for layer in np.moveaxis(tiled, -1, 0)], -1
        )

    np.testing.assert_allclose(
        found.base_color, expected(linear_from_srgb(color / 255)) * [0.9, 0.5, 0.2], atol=1e-6
    )
    np.testing.assert_allclose(
        np.stack([found.metallic, found.roughness], -1), expected(both / 255) * [0.7, 0.6], atol=1e-6
    )
    assert (found.specular == 0.3).all()


def test_row_0_of_a_texture_is_at_its_top():
    """As in image files, and as the renderers draw it: v = 1 is the top."""
    rows = np.zeros((4, 1, 3), np.uint8)
    rows[0] = 255
    craft = Spacecraft("c", (square("a", "m", UNIT_UV),), {"m": Material("m", base_color_texture=rows)})
    found = Surface(pieces(craft)).at(*on_square(np.array([[0.5, 7 / 8], [0.5, 1 / 8]])))
    assert found.base_color.tolist() == [[1, 1, 1], [0, 0, 0]]


def test_each_part_has_its_own_material_and_no_surface_has_none():
    black, metal = Material("black", (0.1, 0.1, 0.1), 0, 0.8, 0.5), Material("metal", metallic=1.0)
    parts = (square("a", "metal", UNIT_UV), square("b", "black", UNIT_UV, 1.0))
    craft = Spacecraft("c", parts, {"black": black, "metal": metal})
    triangle = np.array([3, -1, 0])
    points = np.array([[0.2, 0.6, 1.0], [np.nan] * 3, [0.6, 0.2, 0.0]])
    found = Surface(pieces(craft)).at(triangle, points)
    np.testing.assert_array_equal(found.base_color, [[0.1] * 3, [np.nan] * 3, [1.0] * 3])
    np.testing.assert_array_equal(found.metallic, [0, np.nan, 1])
    np.testing.assert_array_equal(found.roughness, [0.8, np.nan, 1])
    np.testing.assert_array_equal(found.specular, [0.5, np.nan, 1])


def test_no_points():
    craft = Spacecraft("c", (square("a", "m", UNIT_UV),), {"m": Material("m")})
    found = Surface(pieces(craft)).at(np.zeros(0, np.int64), np.zeros((0, 3)))
    assert found.base_color.shape == (0, 3)
    assert found.metallic.shape == (0,)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_the_texture_does_not_depend_on_the_size_of_the_spacecraft(scale):
    ramp = np.arange(0, 256, 17, dtype=np.uint8)[None, :, None].repeat(3, axis=2)
    part = square("a", "m", UNIT_UV)
    part = Part("a", part.vertices_body_m * scale, part.faces, part.normals_body, part.uv, "m")
    craft = Spacecraft("c", (part,), {"m": Material("m", base_color_texture=ramp)})
    triangle, points = on_square(np.array([[(5 + 0.5) / 16, 0.3], [(9 + 0.5) / 16, 0.8]]))
    found = Surface(pieces(craft)).at(triangle, points * scale)
    np.testing.assert_allclose(
        found.base_color[:, 0], linear_from_srgb(np.array([85, 153]) / 255), rtol=1e-6
    )


def tilted(tilt: tuple[float, float, float], part: Part) -> np.ndarray:
    """The normal at a point of a square whose material has the same tangent-space normal everywhere."""
    code = np.rint((np.array(tilt) / np.linalg.norm(tilt) + 1) / 2 * 255).astype(np.uint8)
    material = Material("m", normal_texture=code[None, None])
    craft = Spacecraft("c", (part,), {"m": material})
    return Surface(pieces(craft)).normals(*on_square(np.array([[0.3, 0.6], [0.6, 0.3]])))


def test_normal_maps_tilt_towards_u_and_v():
    """Red tilts along the direction in which u grows, green along that in which v grows."""
    part = square("a", "m", UNIT_UV)
    want = np.array([0.3, 0.2, -1.0]) / np.linalg.norm([0.3, 0.2, 1.0])  # the square's normal is −z
    np.testing.assert_allclose(tilted((0.3, 0.2, 1.0), part), [want, want], atol=8e-3)
    x, y = UNIT_UV.T
    turned = square("a", "m", np.stack([y, 1 - x], axis=1))  # u grows along y, and v along −x
    want = np.array([-0.2, 0.3, -1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
    np.testing.assert_allclose(tilted((0.3, 0.2, 1.0), turned), [want, want], atol=8e-3)


def test_a_flat_map_and_missing_texture_coordinates_leave_the_normal():
    part = square("a", "m", UNIT_UV)
    np.testing.assert_allclose(tilted((0, 0, 1), part), [[0, 0, -1]] * 2, atol=8e-3)
    np.testing.assert_array_equal(tilted((0.3, 0.2, 1), square("a", "m", 0 * UNIT_UV)), [[0, 0, -1]] * 2)


def test_normals_are_interpolated_between_the_corners():
    corners = np.array([[0.3, 0, -1], [0, 0.4, -1], [-0.2, 0, -1], [0, 0, -1]])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    flat = square("a", "m", UNIT_UV)
    part = Part("a", flat.vertices_body_m, flat.faces, corners.astype(np.float32), flat.uv, "m")
    surface = Surface(pieces(Spacecraft("c", (part,), {"m": Material("m")})))
    found = surface.normals(np.array([0, -1]), np.array([[0.5, 0.25, 0], [0, 0, 0]]))
    want = 0.5 * corners[0] + 0.25 * corners[1] + 0.25 * corners[2]
    np.testing.assert_allclose(found[0], want / np.linalg.norm(want), atol=1e-7)
    assert np.isnan(found[1]).all()
