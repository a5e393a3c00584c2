"""Damage against the whole spacecraft: what is lost, torn and bent, and where the keypoints are."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from posse_core._model.spacecraft import Material
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.damage import DamageConfig
from posse_core._spacecraft import shapes
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.damage import damaged
from posse_core._spacecraft.tearing import refined, torn


def build(name, **options):
    registry = load_plugins().registry
    return registry.create("scene", name, registry.options("scene", name, options)).build()


@pytest.fixture(scope="module")
def craft():
    return build("family", seed=1)


@pytest.fixture(scope="module")
def simple():
    """A bus with a boom that alone holds a dish, and a panel at its other side."""
    made = Assembly("simple")
    made.add("bus", "grey", shapes.box((1.0, 1.0, 1.0)))
    made.add("boom", "grey", shapes.tube([(0.4, 0.0, 0.0), (2.0, 0.0, 0.0)], 0.03))
    made.add("dish", "grey", shapes.cylinder(0.4, 0.2).at((2.0, 0.0, -0.1)))
    made.add("panel", "grey", shapes.panel(2.0, 0.8, 0.02).at((-1.45, 0.0, 0.0)))
    made.add("tip", "grey", shapes.box((0.1, 0.1, 0.1)).at((-2.45, 0.0, 0.0)))
    made.mark("T1", "bus", (0.5, 0.5, 0.5))
    made.mark("A1", "dish", (2.4, 0.0, 0.1))
    made.mark("S1", "panel", (-2.45, 0.4, 0.01))
    made.mark("S2", "tip", (-2.5, 0.05, 0.05))
    return made.finish({"grey": Material("grey")}, (0.0, 0.0, 0.0), [("A1", "S1"), ("T1", "S2")])


def all_triangles(craft):
    starts = np.cumsum([0, *(len(part.vertices_body_m) for part in craft.parts[:-1])])
    faces = [part.faces + start for part, start in zip(craft.parts, starts, strict=True)]
    return np.concatenate([part.vertices_body_m for part in craft.parts]), np.concatenate(faces)


def names(craft):
    return {part.name for part in craft.parts}


def area(part):
    return trimesh.Trimesh(part.vertices_body_m, part.faces, process=False).area


def test_without_damage_it_is_the_same_spacecraft(craft):
    assert damaged(craft, DamageConfig(), 3) is craft


def test_what_only_a_lost_part_holds_is_lost_with_it(simple):
    seen = set()
    for seed in range(40):
        left = damaged(simple, DamageConfig(missing_parts=1), seed)
        lost = frozenset(names(simple) - names(left))
        seen.add(lost)
        assert "A1" in left.keypoints_body_m or "dish" in lost
        assert all(set(pair) <= set(left.keypoints_body_m) for pair in left.skeleton)
    assert seen == {frozenset(s) for s in (("boom", "dish"), ("dish",), ("panel", "tip"), ("tip",))}


def test_the_bus_is_left_however_many_parts_are_lost(simple):
    left = damaged(simple, DamageConfig(missing_parts=99), 0)
    assert names(left) == {"bus"}
    assert set(left.keypoints_body_m) == {"T1"}


@pytest.mark.parametrize("seed", range(4))
def test_keypoints_stay_on_the_surface_or_are_dropped(craft, seed, distance_to_surface):
    harm = DamageConfig(missing_parts=3, torn_parts=4, bent_parts=3)
    broken = damaged(craft, harm, seed)
    vertices, faces = all_triangles(broken)
    for name, point in broken.keypoints_body_m.items():
        assert distance_to_surface(vertices, faces, point) < 2e-6 * craft.radius_m, name
    assert set(broken.keypoint_joints) <= set(broken.keypoints_body_m)
    assert set(broken.materials) == {part.material for part in broken.parts}
    again = damaged(craft, DamageConfig(seed=seed, missing_parts=3, torn_parts=4, bent_parts=3), 99)
    assert all_triangles(again)[0].tobytes() == vertices.tobytes()


def test_cut_triangles_are_the_same_closed_surface(solid):
    """Neighbours of the triangles that are cut are cut too, so trimesh finds the solid closed."""
    for mesh in (shapes.box((1.0, 2.0, 0.5)), shapes.cylinder(0.7, 1.5, 24), shapes.dish(2.0, 0.8)):
        corners = mesh.vertices_m[mesh.faces]
        before = solid(mesh.vertices_m, mesh.faces)
        centre_m = corners[3].mean(axis=0)
        fine = refined(corners, centre_m, 0.3, 0.05)
        after = solid(fine.reshape(-1, 3), np.arange(3 * len(fine)).reshape(-1, 3))
        assert after.is_watertight
        assert after.area == pytest.approx(before.area, rel=1e-12)
        assert after.volume == pytest.approx(before.volume, rel=1e-12)
        length_m = np.linalg.norm(np.roll(fine, -1, axis=1) - fine, axis=2).max(axis=1)
        near = np.linalg.norm(fine - centre_m, axis=2).min(axis=1) < 0.3
        assert near.sum() > 50
        assert length_m[near].max() <= 0.05


def test_a_tear_is_a_hole_in_the_surface(simple, solid):
    panel = next(part for part in simple.parts if part.name == "panel")
    whole = solid(panel.vertices_body_m, panel.faces)
    rng = np.random.default_rng(5)
    for _ in range(5):
        left = torn(panel, rng)
        mesh = solid(left.vertices_body_m, left.faces)
        assert not mesh.is_watertight
        assert 0.7 * whole.area < mesh.area < 0.99 * whole.area
        middle = mesh.triangles_center
        distance_m = trimesh.proximity.closest_point(whole, middle)[1]
        assert distance_m.max() < 1e-9
        # The hole has a ragged edge: its points are at many distances from its middle.
        alone = trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1)
        rim = mesh.vertices[np.unique(mesh.edges_sorted[alone])]
        from_middle_m = np.linalg.norm(rim - rim.mean(axis=0), axis=1)
        assert len(rim) > 20
        assert from_middle_m.std() > 0.03 * from_middle_m.mean()
        np.testing.assert_allclose(np.linalg.norm(left.normals_body, axis=1), 1.0, atol=1e-6)


def test_a_bent_panel_turns_about_its_inner_edge_with_what_it_holds(simple):
    bent = damaged(simple, DamageConfig(bent_parts=1), 2)
    before, after = ({part.name: part for part in craft.parts} for craft in (simple, bent))
    for name in ("bus", "boom", "dish"):
        assert before[name] is after[name]
    # The edge of the panel that touches the bus is at x = −0.45, where its middle stays.
    ends = (before["panel"].vertices_body_m, after["panel"].vertices_body_m)
    inner = ends[0][:, 0] > -0.46
    assert np.abs(ends[0][inner] - ends[1][inner]).max() < 0.02
    normal = after["panel"].normals_body[0].astype(float)
    angle_deg = np.degrees(np.arccos(normal[2]))
    assert 10.0 <= angle_deg <= 45.0
    assert abs(normal[1]) < 1e-6
    # The tip keeps its place on the panel, and its keypoint its place on the tip.
    for name in ("panel", "tip"):
        x, y = before[name].vertices_body_m, after[name].vertices_body_m
        R = np.array([[normal[2], 0, normal[0]], [0, 1, 0], [-normal[0], 0, normal[2]]])
        pivot = np.array([-0.45, 0.0, 0.0])
        np.testing.assert_allclose(y, (x - pivot) @ R.T + pivot, atol=1e-6)
    point = (simple.keypoints_body_m["S2"] - pivot) @ R.T + pivot
    np.testing.assert_allclose(bent.keypoints_body_m["S2"], point, atol=1e-6)


def test_imported_and_published_craft_can_be_damaged_too(distance_to_surface):
    whole = build("cubesat")
    broken = damaged(whole, DamageConfig(missing_parts=2, torn_parts=2, bent_parts=1), 4)
    assert names(broken) < names(whole)
    assert sum(map(area, broken.parts)) < sum(map(area, whole.parts))
    vertices, faces = all_triangles(broken)
    for name, point in broken.keypoints_body_m.items():
        assert distance_to_surface(vertices, faces, point) < 1e-6, name
