"""Single rays with origins and instants of their own, against closed forms, scipy's rotations and the
view of a camera."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._geometry.raycast import RayCaster
from posse_core._model.craft_state import Rates

seeds = st.integers(0, 2**32 - 1)


def moving(state, v_m_s=(0, 0, 0), omega_body_rad_s=(0, 0, 0), omega_camera_rad_s=(0, 0, 0)):
    rates = Rates(*(np.array(rate, float) for rate in (v_m_s, omega_body_rad_s, omega_camera_rad_s)))
    return dataclasses.replace(state, rates=rates)


@given(seeds, st.sampled_from([4.0, 300.0, 100e3]))
def test_a_plates_distance_point_and_normal(make_scene, make_state, make_plate, seed, distance_m):
    rng = np.random.default_rng(seed)
    caster = RayCaster(make_scene({"plate": make_plate(2, 1.5, cells=3)}))
    R, t = Rotation.random(None, rng).as_matrix(), np.array([0.3, -0.2, distance_m])
    aims_body_m = np.append(rng.uniform(-3, 3, (200, 2)), np.zeros((200, 1)), axis=1)
    origins = rng.normal(0, 0.1, (200, 3))
    aims = aims_body_m @ R.T + t
    length = np.linalg.norm(aims - origins, axis=1)
    hits = caster.rays(make_state(t, R), (aims - origins) * rng.uniform(0.1, 9, (200, 1)), origins)

    inside = (np.abs(aims_body_m[:, :2]) < [2, 1.5]).all(axis=1)
    assert (hits.hit == inside).all()
    assert 20 < inside.sum() < 180
    slack = 1e-9 + 1e-14 * distance_m / np.abs(R[2, 2])  # rounding grows as the plate is seen edge on
    np.testing.assert_allclose(hits.distance_m[inside], length[inside], rtol=0, atol=10 * slack)
    np.testing.assert_allclose(hits.point_body_m[inside], aims_body_m[inside], atol=10 * slack)
    facing = R[:, 2] * -np.sign((aims - origins) @ R[:, 2])[:, None]
    np.testing.assert_allclose(hits.normal[inside], facing[inside], atol=1e-12)
    assert np.isinf(hits.distance_m[~inside]).all()
    assert np.isnan(hits.normal[~inside]).all()
    assert np.isnan(hits.point_body_m[~inside]).all()
    assert (hits.part_id == np.where(inside, 0, -1)).all()
    assert hits.part_id.dtype == np.int16
    assert not hits.lit[~inside].any()


def test_rays_at_a_sphere(make_scene, make_state):
    """The distance lies between those to the inscribed and to the circumscribed sphere."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    inner = np.min(np.sum(mesh.face_normals * mesh.triangles[:, 0], axis=1))
    caster = RayCaster(make_scene({"ball": mesh}))
    centre = np.array([0.5, -0.3, 40.0])
    rng = np.random.default_rng(3)
    origins = rng.normal(0, 5, (2000, 3))
    d = centre + rng.uniform(-1.2, 1.2, (2000, 3)) - origins
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    hits = caster.rays(make_state(centre), d, origins)
    along = np.sum((centre - origins) * d, axis=1)
    miss = np.linalg.norm(centre - origins - along[:, None] * d, axis=1)
    assert hits.hit[miss < inner].all()
    assert not hits.hit[miss > 1].any()
    sure = miss < 0.95 * inner
    assert sure.sum() > 500
    assert (hits.distance_m >= along - np.sqrt(np.maximum(1 - miss**2, 0)) - 1e-9)[sure].all()
    assert (hits.distance_m <= along - np.sqrt(np.maximum(inner**2 - miss**2, 0)) + 1e-9)[sure].all()
    # The triangle's index is that of the mesh's face.
    np.testing.assert_allclose(
        hits.normal[hits.hit], mesh.face_normals[hits.triangle[hits.hit]], atol=1e-12
    )


@given(seeds)
def test_a_ray_at_a_later_instant_meets_the_later_state(make_scene, make_state, seed):
    rng = np.random.default_rng(seed)
    meshes = {"knot": trimesh.creation.torus(1.3, 0.4, 24, 12), "box": trimesh.creation.box((3, 1, 1))}
    caster = RayCaster(make_scene(meshes))
    R = Rotation.random(None, rng).as_matrix()
    state = moving(
        make_state((0.2, 0.1, 20.0), R, rng.normal(size=3)),
        *rng.normal(0, [[0.3], [0.2], [0.01]], (3, 3)),
    )
    d = np.append(rng.uniform(-0.1, 0.1, (40, 2)), np.ones((40, 1)), axis=1)
    origins = rng.uniform(-0.3, 0.3, (40, 3))
    after_s = rng.uniform(-2, 2, 40)
    together = caster.rays(state, d, origins, after_s)
    apart = [
        caster.rays(state.after(s), d[i : i + 1], origins[i]) for i, s in enumerate(after_s.tolist())
    ]
    shared = [caster.rays(state, d[i : i + 1], origins[i], s) for i, s in enumerate(after_s.tolist())]
    for name in ("distance_m", "part_id", "normal", "point_body_m", "lit", "triangle"):
        one_by_one = np.concatenate([getattr(hits, name) for hits in apart])
        np.testing.assert_allclose(getattr(together, name), one_by_one, rtol=0, atol=1e-10)
        np.testing.assert_array_equal(
            np.concatenate([getattr(hits, name) for hits in shared]), one_by_one
        )
    # The point moves with the body: its position by the rates is where the ray met it.
    there = state.in_camera(together.point_body_m, after_s)
    unit = d / np.linalg.norm(d, axis=1, keepdims=True)
    hit = together.hit
    np.testing.assert_allclose(
        there[hit], (origins + together.distance_m[:, None] * unit)[hit], rtol=0, atol=1e-10
    )


def test_a_plate_that_approaches_and_one_that_turns(make_scene, make_state, make_plate):
    caster = RayCaster(make_scene({"plate": make_plate(2, 2)}))
    after_s = np.linspace(-1, 1, 21)
    ahead = np.broadcast_to([0.0, 0.0, 1.0], (21, 3))
    approaching = moving(make_state((0, 0, 10)), v_m_s=(0, 0, -0.7))
    hits = caster.rays(approaching, ahead, after_s=after_s)
    np.testing.assert_allclose(hits.distance_m, 10 - 0.7 * after_s, rtol=0, atol=1e-12)
    # About its own y axis, by 0.3 rad/s: a ray at x = 0.5 meets it at z = 10 − 0.5 tan(0.3 t).
    turning = moving(make_state((0, 0, 10)), omega_body_rad_s=(0, 0.3, 0))
    hits = caster.rays(turning, ahead, np.array([0.5, 0, 0]), after_s)
    np.testing.assert_allclose(hits.distance_m, 10 - 0.5 * np.tan(0.3 * after_s), rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        hits.normal,
        np.stack([-np.sin(0.3 * after_s), 0 * after_s, -np.cos(0.3 * after_s)], axis=1),
        atol=1e-12,
    )


def test_the_sun_stands_still_while_the_body_and_the_camera_turn(make_scene, make_state, make_plate):
    """A plate turns under the Sun; it is lit while the Sun is on the camera's side."""
    caster = RayCaster(make_scene({"plate": make_plate(2, 2)}))
    after_s = np.linspace(-1.5, 1.5, 31)
    state = moving(
        make_state((0, 0, 10), sun_body=(1, 0, -0.1)),
        omega_body_rad_s=(0, 0.4, 0),
        omega_camera_rad_s=(0, 0, 0.2),
    )
    hits = caster.rays(state, np.broadcast_to([0.0, 0.0, 1.0], (31, 3)), after_s=after_s)
    turned = 0.4 * after_s
    towards_sun = -np.sin(turned) * 1 + -np.cos(turned) * -0.1  # of the normal on the camera's side
    assert hits.hit.all()
    assert (hits.lit == (towards_sun > 0)).all()
    assert 5 < hits.lit.sum() < 26


@given(seeds)
def test_rays_through_pixels_are_the_cameras_view(make_scene, make_state, seed):
    rng = np.random.default_rng(seed)
    meshes = {"knot": trimesh.creation.torus(1.3, 0.4, 24, 12), "box": trimesh.creation.box((3, 1, 1))}
    scene = make_scene(meshes)
    caster = RayCaster(scene)
    state = make_state((0.1, 0.2, 6.0), Rotation.random(None, rng).as_matrix(), rng.normal(size=3))
    view = caster.view(state)
    d = scene.camera.rays(view.box.pixel_centres_px()).reshape(-1, 3)
    hits = caster.rays(state, d)
    depth_m = hits.distance_m / np.linalg.norm(d, axis=1)
    assert (hits.part_id == view.part_id.ravel()).all()
    # A pixel whose shadow ray grazes an edge may be decided otherwise by the last bit.
    assert (hits.lit == view.lit.ravel()).mean() > 0.998
    np.testing.assert_allclose(np.where(hits.hit, depth_m, np.nan), view.depth_m.ravel(), rtol=1e-7)
    np.testing.assert_allclose(hits.normal, view.normal_cam.reshape(-1, 3), atol=1e-7)


def test_no_rays_and_more_than_one_block(make_scene, make_state, make_plate):
    caster = RayCaster(make_scene({"plate": make_plate(1, 1)}))
    state = moving(make_state((0, 0, 5)), v_m_s=(0, 0, 0.5))
    none = caster.rays(state, np.zeros((0, 3)))
    assert none.distance_m.shape == (0,)
    assert none.normal.shape == none.point_body_m.shape == (0, 3)
    many = caster.rays(
        state, np.broadcast_to([0.0, 0.0, 1.0], (20_000, 3)), after_s=np.arange(20_000) * 1e-4
    )
    np.testing.assert_allclose(many.distance_m, 5 + 0.5e-4 * np.arange(20_000), rtol=1e-13)


def test_triangles_are_counted_with_those_without_area(make_scene, make_state, make_plate):
    plate = make_plate(1, 1)
    faces = np.concatenate([[[0, 0, 1]], plate.faces, [[2, 2, 2]]])
    broken = trimesh.Trimesh(plate.vertices, faces, process=False)
    caster = RayCaster(make_scene({"near": broken, "far": make_plate(3, 3, (0, 0, 1))}))
    d = np.array([[-0.1, -0.1, 1], [0.1, 0.1, 1], [-0.4, -0.4, 1], [0.4, 0.4, 1], [2, 2, 1]])
    hits = caster.rays(make_state((0, 0, 5)), d)
    assert hits.triangle.tolist() == [1, 2, 4, 5, -1]
    assert hits.part_id.tolist() == [0, 0, 1, 1, -1]


def test_a_ray_without_a_direction_is_refused(make_scene, make_state, make_plate):
    caster = RayCaster(make_scene({"plate": make_plate(1, 1)}))
    with pytest.raises(ValueError, match="without a direction"):
        caster.rays(make_state((0, 0, 5)), np.zeros((2, 3)))
