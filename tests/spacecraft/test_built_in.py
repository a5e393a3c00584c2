"""The built-in spacecraft against their published dimensions and the requirements on spacecraft."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from posse_core._errors import InputError
from posse_core._frames import unit
from posse_core._plugins.loading import load_plugins

NAMES = ("aqua", "cluster", "cubesat", "tango")
SPEED_BODY = ("B4", "B5", "B6", "B7")
"""Keypoints of SPEED, published 12 mm below the body's corners."""


def build(name, **options):
    registry = load_plugins().registry
    return registry.create("scene", name, registry.options("scene", name, options)).build()


@pytest.fixture(scope="module")
def crafts():
    return {name: build(name) for name in NAMES}


@pytest.fixture(params=NAMES)
def craft(request, crafts):
    return crafts[request.param]


def all_triangles(craft):
    starts = np.cumsum([0, *(len(part.vertices_body_m) for part in craft.parts[:-1])])
    vertices = np.concatenate([part.vertices_body_m for part in craft.parts])
    faces = [part.faces + start for part, start in zip(craft.parts, starts, strict=True)]
    return vertices, np.concatenate(faces)


def test_aqua_has_its_published_size(crafts):
    """NASA gives 8.04 × 16.70 × 4.81 m, which the thesis' Table 3.2 rounds to 8, 16.7 and 4.8 m."""
    size = np.diff(crafts["aqua"].bounds_body_m, axis=0)[0]
    np.testing.assert_allclose(size, (8.04, 16.70, 4.81), atol=1e-6)


def test_clusters_drum_and_bounding_box_agree_with_the_thesis(crafts):
    """Table 3.2: body 2.9 × 1.3 × 2.9 m; bounding box 0.616 : 0.378 : 1."""
    parts = [part for part in crafts["cluster"].parts if part.name.startswith("solar")]
    points = np.concatenate([part.vertices_body_m for part in parts])
    radius = np.hypot(points[:, 0], points[:, 2])
    assert 2.0 * radius.max() == pytest.approx(2.9)
    assert np.ptp(points[:, 1]) == pytest.approx(1.3)
    size = np.diff(crafts["cluster"].bounds_body_m, axis=0)[0]
    np.testing.assert_allclose(size / size[2], (0.616, 0.378, 1.0), atol=0.015)


def test_the_cubesat_follows_the_design_specification(crafts):
    """CDS rev. 14.1: 100 × 100 × 340.5 mm over the rails, which are at least 8.5 mm wide."""
    (rails,) = (part for part in crafts["cubesat"].parts if part.name == "rails")
    np.testing.assert_allclose(np.ptp(rails.vertices_body_m, axis=0), (0.1, 0.1, 0.3405), atol=1e-9)


def test_tango_is_speeds_target(crafts):
    """The keypoints of SPEED+, and without antennas PRISMA's published 80 × 75 × 32 cm."""
    tango = crafts["tango"]
    assert list(tango.keypoints_body_m) == ["S0", "S1", "S2", "S3", *SPEED_BODY, "A8", "A9", "A10"]
    np.testing.assert_array_equal(tango.keypoints_body_m["A9"], (0.5427, 0.4877, 0.2591))
    np.testing.assert_array_equal(tango.keypoints_body_m["B5"], (-0.37, 0.304, 0.0))
    antennas = ("antenna_", "rod_", "probe_", "tab")
    points = np.concatenate(
        [part.vertices_body_m for part in tango.parts if not part.name.startswith(antennas)]
    )
    np.testing.assert_allclose(np.ptp(points, axis=0), (0.75, 0.80, 0.32), atol=0.035)


def test_clusters_booms_are_five_metres_long(crafts):
    for keypoint in ("A3", "A4"):
        x, _, z = crafts["cluster"].keypoints_body_m[keypoint]
        assert np.hypot(x, z) - 1.45 == pytest.approx(5.0)


def test_the_focus_of_amsr_es_reflector_is_at_the_feeds(crafts):
    """Rays from AMSR-E's viewing direction, 47.4° off the nadir, are reflected to a point above the
    drum."""
    parts = {part.name: part for part in crafts["aqua"].parts}
    dish = parts["amsr_dish"]
    boresight = np.array([np.sin(np.radians(47.4)), 0.0, np.cos(np.radians(47.4))])
    front = dish.normals_body @ boresight > 0.1
    points, normals = dish.vertices_body_m[front], dish.normals_body[front].astype(np.float64)
    reflected = -boresight + 2.0 * (normals @ boresight)[:, None] * normals
    # The point with the least sum of squared distances to the reflected rays.
    across = np.eye(3) - reflected[:, :, None] * reflected[:, None, :]
    focus = np.linalg.solve(across.sum(axis=0), (across @ points[:, :, None]).sum(axis=0))[:, 0]
    assert np.linalg.norm(np.cross(reflected, focus - points), axis=1).max() < 1e-4
    feeds = parts["amsr_feeds"].vertices_body_m
    low, high = feeds.min(axis=0), feeds.max(axis=0)
    assert np.all(focus > low - 0.15)
    assert np.all(focus < high + 0.15)


def test_parts_and_materials_are_well_formed(craft, solid):
    names = [part.name for part in craft.parts]
    assert len(set(names)) == len(names)
    assert sum(len(part.faces) for part in craft.parts) > (
        1000 if craft.name in ("cubesat", "tango") else 5000
    )
    for part in craft.parts:
        assert part.material in craft.materials
        assert part.vertices_body_m.dtype == np.float64
        assert part.normals_body.dtype == part.uv.dtype == np.float32
        assert part.faces.dtype == np.int32
        assert part.normals_body.shape == part.vertices_body_m.shape
        assert part.uv.shape == (len(part.vertices_body_m), 2)
        merged = solid(part.vertices_body_m, part.faces)
        assert merged.is_watertight, part.name
        assert merged.volume > 0.0, part.name
    assert set(craft.materials) == {part.material for part in craft.parts}


def test_keypoints_are_on_the_surface(craft, distance_to_surface):
    vertices, faces = all_triangles(craft)
    assert len(craft.keypoints_body_m) >= 11
    for name, point in craft.keypoints_body_m.items():
        limit = 0.013 if craft.name == "tango" and name in SPEED_BODY else 1e-9
        assert distance_to_surface(vertices, faces, point) < limit, name


def test_keypoints_have_the_thesis_categories(craft):
    """Table 3.6: top, bottom, antenna and solar panel; SPEED's eleven points have none at the top."""
    categories = {re.fullmatch(r"([TBAS])\d+", name).group(1) for name in craft.keypoints_body_m}
    assert categories == set("BAS" if craft.name == "tango" else "TBAS")
    for pair in craft.skeleton:
        assert set(pair) <= set(craft.keypoints_body_m)


def test_materials_are_physical(craft):
    for material in craft.materials.values():
        assert all(0.0 <= c <= 1.0 for c in material.base_color)
        assert 0.0 <= material.metallic <= 1.0
        assert 0.0 <= material.roughness <= 1.0
        if material.normal_texture is not None:
            normals = material.normal_texture / 127.5 - 1.0
            np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=0.02)
            assert normals[..., 2].min() > 0.0


def digest(craft):
    sha = hashlib.sha256()
    for part in craft.parts:
        sha.update(part.name.encode())
        for array in (part.vertices_body_m, part.faces, part.normals_body, part.uv):
            sha.update(np.ascontiguousarray(array).tobytes())
    for material in craft.materials.values():
        sha.update(
            repr((material.name, material.base_color, material.metallic, material.roughness)).encode()
        )
        for texture in (
            material.base_color_texture,
            material.metallic_roughness_texture,
            material.normal_texture,
        ):
            sha.update(b"" if texture is None else texture.tobytes())
    for name, point in craft.keypoints_body_m.items():
        sha.update(name.encode() + point.tobytes())
    return sha.hexdigest()


def test_another_process_builds_the_same_to_the_bit(crafts):
    """Hash seeds, and with them the order of sets, differ between processes."""
    code = (
        "import importlib.util, sys;"
        "spec = importlib.util.spec_from_file_location('t', sys.argv[1]);"
        "t = importlib.util.module_from_spec(spec); spec.loader.exec_module(t);"
        "print(t.digest(t.build('cluster')))"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, __file__], capture_output=True, text=True, check=True
    )
    assert out.stdout.strip() == digest(crafts["cluster"])


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", NAMES)
def test_variants_keep_keypoints_on_the_surface_and_known_names(name, seed, crafts, distance_to_surface):
    variant = build(name, variant_seed=seed, variant_missing_parts=3)
    vertices, faces = all_triangles(variant)
    for keypoint, point in variant.keypoints_body_m.items():
        limit = 0.013 if name == "tango" and keypoint in SPEED_BODY else 1e-9
        assert distance_to_surface(vertices, faces, point) < limit, keypoint
    assert {part.name for part in variant.parts} <= {part.name for part in crafts[name].parts}
    assert set(variant.keypoints_body_m) <= set(crafts[name].keypoints_body_m)
    for pair in variant.skeleton:
        assert set(pair) <= set(variant.keypoints_body_m)
    for material in variant.materials.values():
        assert all(0.0 <= c <= 1.0 for c in material.base_color)
        assert 0.0 < material.roughness <= 1.0


def test_variants_depend_on_the_seed_alone():
    one, again, other = (build("cubesat", variant_seed=seed) for seed in (5, 5, 6))
    assert digest(one) == digest(again)
    assert digest(one) != digest(other)
    for part, other_part in zip(one.parts, other.parts, strict=False):
        if part.name == other_part.name == "rails":
            np.testing.assert_array_equal(part.vertices_body_m, other_part.vertices_body_m)


def test_some_variants_lack_parts_but_not_more_than_allowed():
    whole = {part.name for part in build("cubesat").parts}
    lost = [
        whole
        - {part.name for part in build("cubesat", variant_seed=seed, variant_missing_parts=1).parts}
        for seed in range(5)
    ]
    assert {len(parts) for parts in lost} == {0, 1}
    for seed in range(2):
        variant = build("cubesat", variant_seed=seed, variant_missing_parts=0)
        assert {part.name for part in variant.parts} == whole


def test_keypoints_of_missing_parts_are_missing_too():
    craft = build("cubesat", missing_parts=["wing_left", "tape_1"])
    assert not {"wing_left", "tape_1"} & {part.name for part in craft.parts}
    assert not {"S3", "S4", "A1"} & set(craft.keypoints_body_m)
    assert "S1" in craft.keypoints_body_m
    with pytest.raises(InputError, match="did you mean 'wing_left'"):
        build("cubesat", missing_parts=["wing_lef"])


def test_the_panel_angle_rotates_the_wing_and_its_keypoints(crafts, distance_to_surface):
    turned = build("aqua", panel_angle_deg=60.0)
    vertices, faces = all_triangles(turned)
    for name in ("S1", "S2", "S3", "S4"):
        assert distance_to_surface(vertices, faces, turned.keypoints_body_m[name]) < 1e-9
    before = crafts["aqua"].keypoints_body_m["S1"] - crafts["aqua"].keypoints_body_m["S2"]
    after = turned.keypoints_body_m["S1"] - turned.keypoints_body_m["S2"]
    cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
    assert cosine == pytest.approx(np.cos(np.radians(60.0)))
    np.testing.assert_array_equal(turned.keypoints_body_m["T1"], crafts["aqua"].keypoints_body_m["T1"])


def test_no_two_parts_have_a_surface_in_one_place(craft):
    """Which of the two a ray hits would be left to rounding.

    From where rays from outside meet a part, they go on to all other parts, and none of these has a
    parallel face there.
    """
    vertices, faces = all_triangles(craft)
    whole = trimesh.Trimesh(vertices, faces, process=False)
    part = np.repeat(np.arange(len(craft.parts)), [len(each.faces) for each in craft.parts])
    rng = np.random.default_rng(0)
    aim = rng.choice(len(faces), 60_000, p=whole.area_faces / whole.area)
    target = np.einsum("nk,nkx->nx", rng.dirichlet((1, 1, 1), len(aim)), vertices[faces[aim]])
    toward = unit(rng.normal(size=target.shape))
    first = whole.ray.intersects_first(target - 3 * craft.radius_m * toward, toward)
    grazing = np.abs(np.sum(toward * whole.face_normals[first], axis=1)) < 0.1
    first[grazing] = -1
    shared = 0
    for k in range(len(craft.parts)):
        rays = np.flatnonzero((first >= 0) & (part[first] == k))
        plane, ahead = whole.face_normals[first[rays]], toward[rays]
        # In double precision, from the triangle's plane.
        to_plane = np.sum((vertices[faces[first[rays], 0]] - target[rays]) * plane, axis=1)
        points = target[rays] + (to_plane / np.sum(ahead * plane, axis=1))[:, None] * ahead
        others = trimesh.Trimesh(vertices, faces[part != k], process=False)
        hit = others.ray.intersects_first(points - 1e-3 * craft.radius_m * ahead, ahead)
        normal = others.face_normals[hit]
        gap = np.abs(np.sum((vertices[others.faces[hit, 0]] - points) * normal, axis=1))
        parallel = np.abs(np.sum(normal * plane, axis=1)) > 0.999
        shared += np.sum((hit >= 0) & parallel & (gap < 1e-6 * craft.radius_m))
    assert shared <= 3  # of 60,000: where curved surfaces cross
