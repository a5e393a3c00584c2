"""Rays against a plain Möller–Trumbore intersection in camera axes, and difficult cases: edges, near and
far distances."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._geometry import instant
from posse_core._geometry.raycast import RayCaster
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles
from posse_core._model.labels import View

seeds = st.integers(0, 2**32 - 1)


def moller_trumbore(corners, origins, directions):
    """Intersect all rays with all triangles (Möller and Trumbore 1997).

    Returns:
        Distance (N, T), infinite for a miss, and the least barycentric coordinate (N, T) of the point on
        the triangle's plane, which is 0 on an edge.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    p = np.cross(directions[:, None], (c - a)[None])
    det = np.sum((b - a) * p, axis=-1)
    s = origins[:, None] - a
    u = np.sum(s * p, axis=-1) / det
    q = np.cross(s, b - a)
    v = np.sum(directions[:, None] * q, axis=-1) / det
    t = np.sum((c - a) * q, axis=-1) / det
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    return np.where((least >= 0) & (t > 0), t, np.inf), least


def soup(rng, count):
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.6, (count, 3, 3))
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), process=False)


def fields(view: View) -> dict[str, np.ndarray]:
    return {field.name: np.asarray(getattr(view, field.name)) for field in dataclasses.fields(view)
            if field.name != "box"}  # fmt: skip


@given(seeds, st.sampled_from([0.5, 4.0, 30.0, 100e3]))
def test_every_ray_hits_the_triangle_of_an_exhaustive_search(make_scene, make_state, seed, distance_m):
    """At 0.5 m the camera is inside the spacecraft, which also reaches behind it."""
    rng = np.random.default_rng(seed)
    meshes = {"a": soup(rng, 20), "b": soup(rng, 20)}
    scene = make_scene(meshes, width_px=24, height_px=18, focal_px=6 * distance_m)
    R = Rotation.random(None, rng).as_matrix()
    t = np.append(rng.uniform(-0.4, 0.4, 2), distance_m)
    sun = rng.normal(size=3)
    sun /= np.linalg.norm(sun)
    view = RayCaster(scene).view(make_state(t, R, sun))

    corners = np.concatenate([m.triangles for m in meshes.values()]) @ R.T + t
    d = scene.camera.rays(view.box.pixel_centres_px()).reshape(-1, 3)
    z, least = moller_trumbore(corners, np.zeros((1, 3)), d)
    nearest = z.argmin(axis=1)
    depth = z[np.arange(len(d)), nearest]
    hit = np.isfinite(depth)
    clear = (
        np.abs(least).min(axis=1) > 1e-5
    )  # far enough from edges that Embree's rounding does not matter
    assert clear.mean() > 0.98
    expected_part = np.where(hit, nearest // 20, -1)
    assert (view.part_id.ravel() == expected_part)[clear].all()
    np.testing.assert_allclose(view.depth_m.ravel()[clear & hit], depth[clear & hit], rtol=1e-6)

    rays = np.flatnonzero(clear & hit)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[nearest[rays]]
    normal /= -np.sign(np.sum(normal * d[rays], axis=1, keepdims=True)) * np.linalg.norm(
        normal, axis=1, keepdims=True
    )
    np.testing.assert_allclose(view.normal_cam.reshape(-1, 3)[rays], normal, atol=1e-6)
    sun_cam = R @ sun
    points = d[rays] * depth[rays, None]
    blocked, least = moller_trumbore(corners, points, np.broadcast_to(sun_cam, points.shape))
    blocked[np.arange(len(rays)), nearest[rays]] = np.inf
    clear = (np.abs(least).min(axis=1) > 1e-5) & (blocked.min(axis=1, initial=np.inf) > 1e-3)
    lit = (np.sum(normal * sun_cam, axis=1) > 0) & ~np.isfinite(blocked).any(axis=1)
    assert (view.lit.ravel()[rays] == lit)[clear].all()


def test_rays_through_shared_edges_leave_no_holes(make_scene, make_state, make_plate):
    """The plate is divided into squares whose edges and corners lie on pixel centres."""
    scene = make_scene({"plate": make_plate(2, 2, cells=16)}, width_px=33, height_px=33, focal_px=16)
    view = RayCaster(scene).view(make_state((0, 0, 4), sun_body=(0.1, 0.2, -1)))
    assert view.mask.shape == (17, 17)
    assert view.mask[1:-1, 1:-1].all()  # rounding decides at the plate's border
    assert (view.depth_m[view.mask] == 4).all()
    assert (view.lit == view.mask).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_closed_body_has_no_holes(make_scene, make_state, seed):
    R = Rotation.random(None, np.random.default_rng(seed)).as_matrix()
    scene = make_scene({"ball": trimesh.creation.icosphere(4)}, width_px=50, height_px=50, focal_px=25)
    inside = RayCaster(scene).view(make_state((0.1, 0.2, -0.3), R))
    assert inside.mask.all()
    assert inside.mask.size == 2500
    assert not inside.lit.any()


def test_a_camera_inside_a_cube_sees_its_walls(make_scene, make_state):
    scene = make_scene({"cube": trimesh.creation.box((4, 4, 4))})
    view = RayCaster(scene).view(make_state((0.5, 0.1, 0.3)))
    d = scene.camera.rays(view.box.pixel_centres_px())
    high, low = np.array([2.5, 2.1, 2.3]), np.array([-1.5, -1.9, -1.7])
    wall = np.where(d > 0, high / d, np.where(d < 0, low / d, np.inf)).min(axis=-1)
    np.testing.assert_allclose(view.depth_m, wall, rtol=1e-6)
    assert np.isnan(view.whole_box_px).all()


def test_a_face_seen_edge_on_covers_no_pixel(make_scene, make_state, make_plate):
    edge_on = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    edge_on = np.round(edge_on)
    scene = make_scene({"plate": make_plate(1, 1)}, width_px=33, height_px=33, focal_px=32)
    view = RayCaster(scene).view(make_state((0, 0, 4), edge_on))
    assert view.box.height == 1
    assert not view.mask.any()


def entry(camera, d, half):
    """(N,) parameter at which rays (3, N) enter the box of half sides (3,) about the origin; infinite
    for a miss."""
    near, far = np.sort([(s * half[:, None] - camera[:, None]) / d for s in (-1, 1)], axis=0)
    near, far = near.max(axis=0), far.min(axis=0)
    return np.where(near <= far, near, np.inf)


@given(seeds)
def test_rays_along_a_long_face_are_decided_in_double_precision(make_scene, seed):
    """The camera is within 1e-6 m of the face's plane, where Embree's result is arbitrary."""
    rng = np.random.default_rng(seed)
    half = np.array([5.0, 0.1, 0.1])
    tracer = Tracer(Triangles.of(make_scene({"beam": trimesh.creation.box(2 * half)}).spacecraft))
    camera = np.array([-35.0, 0.1 + rng.uniform(-1e-6, 1e-6), 0.01])
    d = np.stack([np.ones(200), *rng.uniform(-1, 1, (2, 200)) * [[3e-8], [2e-3]]])
    triangle, x = tracer.first(camera[:, None], d, 0.0)
    rounding_m = 2e-8
    found = triangle >= 0
    assert (x >= entry(camera, d, half + rounding_m) - rounding_m)[found].all()
    assert (x <= entry(camera, d, half - rounding_m) + rounding_m)[found].all()
    assert not np.isfinite(entry(camera, d, half - 1e-5)[~found]).any()


def test_a_spacecraft_behind_the_camera_is_not_seen(make_scene, make_state):
    scene = make_scene({"cube": trimesh.creation.box((2, 2, 2))}, {"T1": (0, 0, -1)})
    view = RayCaster(scene).view(make_state((0, 0, -5)))
    assert view.box.is_empty
    assert view.silhouette_px == 0
    assert view.keypoints_visibility.tolist() == [0]
    assert np.isnan(view.keypoints_px).all()
    assert np.isnan(view.whole_box_px).all()


@pytest.mark.parametrize("where_m", [(4.0, 1.0, 8.0), (-6.0, 0.3, 8.0), (20.0, 3.0, 8.0), (0, 0, 2.0)])
def test_the_silhouette_agrees_with_a_larger_image(make_scene, make_state, where_m):
    meshes = {"knot": trimesh.creation.torus(1.3, 0.4, 24, 12)}
    R = Rotation.from_euler("xyz", (0.4, 0.9, 0.2)).as_matrix()
    view = RayCaster(make_scene(meshes)).view(make_state(where_m, R))
    larger = make_scene(meshes, width_px=464, height_px=448, middle_px=(231.5, 223.5))
    whole = RayCaster(larger).view(make_state(where_m, R))
    assert whole.silhouette_px == whole.mask.sum() == view.silhouette_px > 100
    assert view.mask.sum() < view.silhouette_px
    cut = np.zeros((448, 464), bool)
    cut[whole.box.slices] = whole.mask
    assert view.mask.sum() == cut[200:248, 200:264].sum()


def test_a_very_large_silhouette_is_sampled(make_scene, make_state, make_plate, monkeypatch):
    scene = make_scene({"plate": make_plate(3, 3)})
    state = make_state((0.2, 0.1, 0.5))
    exact = RayCaster(scene).view(state).silhouette_px
    monkeypatch.setattr(instant, "SILHOUETTE_RAYS", 20_000)
    assert RayCaster(scene).view(state).silhouette_px == pytest.approx(exact, rel=0.02)
    assert exact == pytest.approx((2 * 3 * 48 / 0.5) ** 2, rel=0.01)


def test_a_spacecraft_smaller_than_a_pixel_has_a_box_but_no_mask(make_scene, make_state):
    scene = make_scene({"cube": trimesh.creation.box((2, 2, 2))}, {"T1": (0, 0, -1)})
    view = RayCaster(scene).view(make_state((300.0, 100.0, 100e3)))
    assert (view.box.width, view.box.height, view.silhouette_px) == (1, 1, 0)
    assert not view.mask.any()
    assert view.keypoints_visibility.tolist() == [2]


def test_triangles_without_area_change_nothing(make_scene, make_state, make_plate):
    plate = make_plate(1, 1)
    faces = np.concatenate([plate.faces, [[0, 0, 1], [2, 2, 2]]])
    broken = trimesh.Trimesh(plate.vertices, faces, process=False)
    state = make_state((0.1, 0.2, 3))
    good, bad = (RayCaster(make_scene({"p": mesh})).view(state) for mesh in (plate, broken))
    assert fields(good).keys() == fields(bad).keys()
    for name, array in fields(good).items():
        np.testing.assert_array_equal(array, fields(bad)[name])


def test_views_are_equal_to_the_bit_in_any_order_and_any_crop(make_scene, make_state, monkeypatch):
    meshes = {"knot": trimesh.creation.torus(1.3, 0.4, 48, 24), "box": trimesh.creation.box((3, 1, 1))}
    scene = make_scene(meshes, {"T1": (0.1, 0.2, 0.3)}, width_px=160, height_px=120, focal_px=110)
    turns = Rotation.random(3, np.random.default_rng(1)).as_matrix()
    frames = [make_state((0.1, 0.2, 4.0), R, (0.6, 0.0, -0.8)) for R in turns]
    caster = RayCaster(scene)
    forward = [fields(caster.view(state)) for state in frames]
    backward = [fields(caster.view(state)) for state in frames[::-1]][::-1]
    monkeypatch.setattr(instant, "_CHUNK", 1000)
    fresh = [fields(RayCaster(scene).view(state)) for state in frames]
    for views in zip(forward, backward, fresh, strict=True):
        for name in views[0]:
            assert len({view[name].tobytes() for view in views}) == 1, name
    small = make_scene(meshes, width_px=40, height_px=30, focal_px=110, middle_px=(79.5 - 60, 59.5 - 45))
    cut = fields(RayCaster(small).view(frames[0]))
    box = caster.view(frames[0]).box
    rows, columns = slice(45 - box.y0, 75 - box.y0), slice(60 - box.x0, 100 - box.x0)
    for name in ("part_id", "depth_m", "normal_cam", "lit"):
        assert cut[name].tobytes() == forward[0][name][rows, columns].tobytes(), name
