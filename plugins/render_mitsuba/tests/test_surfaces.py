"""The materials of the compiled variants against glTF 2.0 in closed form and lookups by SciPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from posse_core import AnyArray, Finish, FloatArray, Material, linear_from_srgb
from posse_core.testing import scenes
from posse_core.testing.closed_forms import gltf_brdf
from posse_render_mitsuba.variants import choose

GOLD = Material("gold", base_color=(0.9, 0.6, 0.2), metallic=1.0, roughness=0.4)
PAINT = Material("paint", base_color=(0.3, 0.7, 0.5), roughness=0.6)
MATT = Material("matt", base_color=(0.8, 0.5, 0.2), specular=0.0)
MIXED = Material("mixed", base_color=(0.5, 0.5, 0.6), metallic=0.4, roughness=0.5, specular=0.7)
FLAT = np.array([0.0, 0.0, 1.0])
TILTED = np.array([0.3, -0.2, 0.9])


@pytest.fixture(autouse=True)
def compiled() -> None:
    """Set the compiled variant of this machine."""
    import mitsuba as mi

    choice = choose("auto")
    if choice.variant == "scalar_rgb":
        # These materials are of the compiled variants alone, which need a libLLVM of the system.
        pytest.skip("no libLLVM works on this machine")
    mi.set_variant(choice.variant)


def surface(material: Material, wi: FloatArray, normal: FloatArray, count: int) -> Any:
    import mitsuba as mi

    from posse_render_mitsuba.surfaces import Surface

    def floats(value: float) -> Any:
        return mi.Float(np.full(count, value, dtype=np.float32))

    return Surface(
        mi.Vector3f(*map(floats, wi)),
        mi.Color3f(*map(floats, material.base_color)),
        floats(material.specular),
        floats(material.metallic),
        floats(material.roughness**2),
        mi.Vector3f(*map(floats, normal)),
    )


def on_sphere(count: int, seed: int = 0) -> FloatArray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def unit(*vector: float) -> FloatArray:
    return np.array(vector) / np.linalg.norm(vector)


@pytest.mark.parametrize("material", [GOLD, PAINT, MATT, MIXED], ids=lambda material: material.name)
@pytest.mark.parametrize("normal", [FLAT, TILTED], ids=["flat", "tilted"])
@pytest.mark.parametrize("side", [1, -1], ids=["front", "back"])
def test_light_is_reflected_as_gltf_says(material: Material, normal: FloatArray, side: int) -> None:
    import mitsuba as mi

    wi, wo = unit(0.4, 0.1, 0.8 * side), on_sphere(4000)
    value, _ = surface(material, wi, normal, len(wo)).reflected(mi.Vector3f(wo.T.astype(np.float32)))
    mirrored = np.array([1.0, 1.0, side])  # both sides are alike
    n, to_light = unit(*normal), wo * mirrored
    cosine = np.maximum(to_light @ n, 0.0)[:, None]
    expected = gltf_brdf(material, n, wi * mirrored, to_light) * cosine
    expected[to_light[:, 2] <= 0] = 0.0
    np.testing.assert_allclose(np.array(value).T, expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("material", [GOLD, PAINT, MATT, MIXED], ids=lambda material: material.name)
@pytest.mark.parametrize("wi", [unit(0.1, 0.2, 1.0), unit(0.9, 0.0, -0.3)], ids=["steep", "grazing"])
def test_paths_go_on_with_the_density_that_is_told(material: Material, wi: FloatArray) -> None:
    """In each of 128 parts of the sphere of equal area. Those below the surface end there."""
    import mitsuba as mi

    count, rows, columns, each = 400_000, 8, 16, 50
    random = np.random.default_rng(1)
    seen = surface(material, wi, TILTED, count)
    choice = mi.Float(random.random(count, dtype=np.float32))
    point = mi.Point2f(random.random((2, count), dtype=np.float32))
    scattered = seen.scattered(choice, point)
    x, y, z = np.array(scattered)[:, np.array(seen.reflected(scattered)[1]) > 0]
    row = np.minimum((z + 1) / 2 * rows, rows - 1).astype(int)
    column = ((np.arctan2(y, x) / (2 * np.pi) % 1) * columns).astype(int) % columns
    found = np.bincount(row * columns + column, minlength=rows * columns) / count

    cosine = (np.arange(rows * each) + 0.5) / (rows * each) * 2 - 1
    phi = (np.arange(columns * each) + 0.5) / (columns * each) * 2 * np.pi
    z, phi = (grid.ravel() for grid in np.meshgrid(cosine, phi, indexing="ij"))
    sine = np.sqrt(1 - z**2)
    wo = np.stack([sine * np.cos(phi), sine * np.sin(phi), z]).astype(np.float32)
    _, pdf = surface(material, wi, TILTED, len(z)).reflected(mi.Vector3f(wo))
    cells = np.array(pdf).reshape(rows, each, columns, each).mean(axis=(1, 3)).ravel()
    expected = cells * 4 * np.pi / (rows * columns)
    above = expected > 0.001
    np.testing.assert_allclose(found[above], expected[above], rtol=0.02, atol=6e-4)


def texture(height: int, width: int, channels: int, seed: int) -> AnyArray:
    shape = (height, width, channels)
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


@pytest.mark.parametrize(
    "sizes", [((4, 6), (5, 3), (2, 2)), ((4, 6), (4, 6), (4, 6))], ids=["several sizes", "one size"]
)
def test_textures_repeat_and_are_looked_up_between_their_texels(sizes: Any) -> None:
    """Of each mesh its own, of any size. A frame's finish multiplies them or brings a pattern."""
    import drjit as dr
    import mitsuba as mi

    from posse_render_mitsuba.craft import fixed_shapes
    from posse_render_mitsuba.materials import Materials

    first = replace(
        MIXED,
        base_color_texture=texture(*sizes[0], 3, 1),
        metallic_roughness_texture=texture(*sizes[1], 2, 2),
        normal_texture=texture(*sizes[2], 3, 3),
        patterns=(texture(4, 6, 3, 4),),
    )
    parts = [scenes.rectangle("first", "mixed"), scenes.rectangle("second", "gold")]
    scene = scenes.scene(*parts, materials=(first, GOLD), camera=scenes.camera())
    bsdf = mi.load_dict({"type": "diffuse"})
    shapes = fixed_shapes(scene, lambda piece: bsdf)
    materials = Materials(scene, shapes)

    uv = np.random.default_rng(5).uniform(-2, 2, (2, 500)).astype(np.float32)
    hits = [dr.zeros(mi.SurfaceInteraction3f, uv.shape[1]) for _ in parts]
    for hit, (mesh, _) in zip(hits, shapes.meshes, strict=True):
        hit.uv, hit.shape, hit.wi = mi.Point2f(uv), mi.ShapePtr(mesh), mi.Vector3f(0, 0, 1)

    def looked_up(values: AnyArray) -> FloatArray:
        height, width = values.shape[:2]
        places = [(1 - uv[1]) * height - 0.5, uv[0] * width - 0.5]  # row 0 is at v = 1
        channels = np.moveaxis(values.astype(np.float64), -1, 0)
        return np.array([map_coordinates(c, places, order=1, mode="grid-wrap") for c in channels])

    frame = scenes.frame(t_body_cam_m=(0, 0, 9), sun_direction_body=(0, 0, 1))
    finish = Finish((0.5, 1.0, 2.0), 0.7, pattern=0)
    for finishes, color, factor, roughness in (
        ({}, first.base_color_texture, np.ones(3), 1.0),
        ({"mixed": finish}, first.patterns[0], np.array([0.5, 1.0, 2.0]), 0.7),
    ):
        materials.set(replace(frame.craft, finishes=finishes))
        seen = materials.table.surface(hits[0], True)
        shares = looked_up(first.metallic_roughness_texture / 255)
        expected = looked_up(linear_from_srgb(color / 255)) * (factor * first.base_color)[:, None]
        np.testing.assert_allclose(np.array(seen.color), expected, atol=1e-4)
        np.testing.assert_allclose(np.array(seen.metallic), shares[0] * first.metallic, atol=1e-4)
        alpha = (shares[1] * first.roughness * roughness) ** 2
        np.testing.assert_allclose(np.array(seen.alpha), np.maximum(alpha, 1e-4), atol=1e-4)
        normals = looked_up(first.normal_texture / 255 * 2 - 1)
        np.testing.assert_allclose(np.array(seen.normal), normals, atol=2e-4)
    plain = materials.table.surface(hits[1], True)
    np.testing.assert_allclose(np.array(plain.color)[:, 0], GOLD.base_color, rtol=1e-6)
    np.testing.assert_allclose(np.array(plain.normal)[:, 0], FLAT, atol=2e-5)
