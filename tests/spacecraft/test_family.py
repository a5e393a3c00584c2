"""The family of random spacecraft: sound solids, keypoints and joints at every seed."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh

from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

SEEDS = range(8)


def build(**options):
    registry = load_plugins().registry
    return registry.create("scene", "family", registry.options("scene", "family", options)).build()


@pytest.fixture(scope="module")
def crafts():
    return [build(seed=seed) for seed in SEEDS]


def all_triangles(craft):
    starts = np.cumsum([0, *(len(part.vertices_body_m) for part in craft.parts[:-1])])
    faces = [part.faces + start for part, start in zip(craft.parts, starts, strict=True)]
    return np.concatenate([part.vertices_body_m for part in craft.parts]), np.concatenate(faces)


def test_parts_are_closed_solids_with_their_outside_outward(crafts, solid):
    for craft in crafts:
        for part in craft.parts:
            merged = solid(part.vertices_body_m, part.faces)
            assert merged.is_watertight, (craft.name, part.name)
            assert merged.volume > 0.0, (craft.name, part.name)


def test_keypoints_are_on_the_surface_and_have_the_categories(crafts, distance_to_surface):
    for craft in crafts:
        vertices, faces = all_triangles(craft)
        for name, point in craft.keypoints_body_m.items():
            distance_m = distance_to_surface(vertices, faces, point)
            assert distance_m < 1e-9 * craft.radius_m, (craft.name, name)
        names = craft.keypoints_body_m
        assert {re.fullmatch(r"([TBAS])\d+", name).group(1) for name in names} == set("TBAS")
        assert all(set(pair) <= set(names) for pair in craft.skeleton)


def test_no_faces_of_different_solids_coincide(crafts):
    """Where two lie in one plane and overlap, which of them is seen is chance."""
    for craft in crafts:
        for name, other in coinciding(craft):
            pytest.fail(f"{craft.name}: {name} and {other} have faces in one place")


def coinciding(craft):
    size_m = 2.0 * craft.radius_m
    tiny = 1e-7 * size_m
    corners = np.concatenate([part.vertices_body_m[part.faces] for part in craft.parts])
    owner = np.repeat(np.arange(len(craft.parts)), [len(part.faces) for part in craft.parts])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    first = normal[np.arange(len(normal)), np.abs(normal).argmax(axis=1)]
    normal *= np.sign(first)[:, None]
    height = np.sum(normal * corners[:, 0], axis=1) / size_m
    key = np.round(np.column_stack([normal, height]), 7)
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.lexsort(key.T)
    breaks = np.flatnonzero(np.any(np.diff(key[order], axis=0) != 0, axis=1)) + 1
    for group in np.split(order, breaks):
        for i in group[owner[group] > owner[group].min()]:
            others = group[owner[group] < owner[i]]
            apart = (low[others] >= high[i] - tiny) | (high[others] <= low[i] + tiny)
            flat = high[i] - low[i] < tiny
            others = others[~np.any(apart & ~flat, axis=1)]
            for j in others[[overlap(corners[i], corners[k], normal[i]) for k in others]]:
                yield craft.parts[owner[i]].name, craft.parts[owner[j]].name


def overlap(one, other, normal):
    """Whether two triangles in a plane share an area: no edge of either separates them."""
    for a, b in ((one, other), (other, one)):
        for k in range(3):
            along = a[(k + 1) % 3] - a[k]
            across = np.cross(normal, along)
            heights = [(p - a[k]) @ across for p in (a, b)]
            inner = heights[0][np.abs(heights[0]).argmax()]
            if np.all(heights[1] * np.sign(inner) <= 1e-9 * abs(inner)):
                return False
    return True


def test_parts_do_not_interpenetrate_grossly(crafts):
    """Most of the surface of every fitting is outside of all other parts. The bus is beneath its cells,
    and decks and tapes are slabs through it."""
    for craft in crafts:
        solids = [trimesh.Trimesh(p.vertices_body_m, p.faces, process=False) for p in craft.parts]
        for number, part in enumerate(craft.parts):
            if part.name.startswith(("bus", "deck")):
                continue
            points, faces = trimesh.sample.sample_surface(solids[number], 60, seed=1)
            points = points + 1e-6 * craft.radius_m * solids[number].face_normals[faces]
            buried = np.zeros(len(points), dtype=bool)
            for other, mesh in enumerate(solids):
                inside = np.all((points > mesh.bounds[0]) & (points < mesh.bounds[1]), axis=1)
                if other != number and inside.any():
                    buried[inside] |= mesh.contains(points[inside])
            assert buried.mean() < 0.75, (craft.name, part.name, buried.mean())


def test_the_size_is_within_its_limits():
    for seed in SEEDS[:4]:
        craft = build(seed=seed, size_m=(2.0, 3.0))
        longest_m = np.ptp(craft.bounds_body_m, axis=0).max()
        assert 2.0 - 1e-9 <= longest_m <= 3.0 + 1e-9
    with pytest.raises(InputError, match="size_m"):
        build(size_m=(3.0, 2.0))


def test_seeds_differ_and_a_seed_is_the_same_to_the_bit(crafts):
    again = build(seed=3)
    for part, other in zip(crafts[3].parts, again.parts, strict=True):
        assert part.vertices_body_m.tobytes() == other.vertices_body_m.tobytes()
    for name, material in crafts[3].materials.items():
        assert material.base_color == again.materials[name].base_color
    shapes = {(len(craft.parts), craft.radius_m) for craft in crafts}
    assert len(shapes) == len(SEEDS)


def test_options_choose_the_bus_and_the_number_of_wings():
    for count in (0, 1, 2, 4):
        craft = build(seed=count, wings=(count,), bus=("octagon",))
        wings = [joint for joint in craft.joints if joint.parent is None]
        assert len(wings) == count
        assert sum(name[0] == "T" for name in craft.keypoints_body_m) == 8


def test_wings_turn_about_their_axis_and_hinges_fold_the_panels(crafts):
    """Joints: first of the wing, whose cells face away from its axis, then of its panels in order."""
    for craft in crafts:
        names = [joint.name for joint in craft.joints]
        parts = {part.name: part for part in craft.parts}
        for joint in craft.joints:
            assert joint.parent is None or names.index(joint.parent) < names.index(joint.name)
            if joint.parent is None:
                panel = parts[f"{joint.name}_panel_1"]
                assert abs(joint.facing_body @ joint.axis_body) < 1e-12
                assert panel.normals_body[0] @ joint.facing_body == pytest.approx(1.0, abs=1e-6)
                wing = np.concatenate(
                    [p.vertices_body_m for p in craft.parts if p.name.startswith(f"{joint.name}_panel")]
                )
                from_axis = np.cross(wing.mean(axis=0) - joint.origin_body_m, joint.axis_body)
                assert np.linalg.norm(from_axis) < 1e-6 * craft.radius_m
            else:
                wing, number = re.fullmatch(r"(wing_\d)_hinge_(\d)", joint.name).groups()
                panel = parts[f"{wing}_panel_{number}"]
                assert panel.joint == joint.name
                outward = next(j for j in craft.joints if j.name == wing).axis_body
                assert abs(joint.axis_body @ outward) < 1e-12
                bent = joint.moved(panel.vertices_body_m, np.array(0.1))
                facing = next(j for j in craft.joints if j.name == wing).facing_body
                assert np.mean((bent - panel.vertices_body_m) @ facing) > 0.0
        for keypoint, joint in craft.keypoint_joints.items():
            assert keypoint[0] == "S"
            assert joint in names
