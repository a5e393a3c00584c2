"""Views of plates, boxes and spheres against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from posse_core._geometry.raycast import RayCaster
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE

seeds = st.integers(0, 2**32 - 1)


def full(view, camera, array, fill):
    out = np.full((camera.height_px, camera.width_px, *array.shape[2:]), fill, dtype=array.dtype)
    out[view.box.slices] = array
    return out


def directions(camera):
    u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    return camera.rays(np.stack([u, v], axis=-1))


def random_rotation(seed):
    return Rotation.random(None, np.random.default_rng(seed)).as_matrix()


@pytest.mark.parametrize("distance_m", [5.0, 333.3, 100e3])
def test_a_plate_covers_the_pixels_whose_rays_meet_it(make_scene, make_state, make_plate, distance_m):
    scene = make_scene({"plate": make_plate(1.7, 0.9)}, focal_px=10 * distance_m)
    view = RayCaster(scene).view(make_state((0.1, 0.2, distance_m)))
    x, y, _ = np.moveaxis(directions(scene.camera) * distance_m, -1, 0)
    expected = (np.abs(x - 0.1) < 1.7) & (np.abs(y - 0.2) < 0.9)
    mask = full(view, scene.camera, view.mask, False)
    assert (mask == expected).all()
    assert expected.sum() == view.silhouette_px > 500
    assert (view.depth_m[view.mask] == np.float32(distance_m)).all()
    assert (view.normal_cam[view.mask] == [0, 0, -1]).all()
    assert np.isnan(view.depth_m[~view.mask]).all()
    assert np.isnan(view.normal_cam[~view.mask]).all()
    assert not view.lit[~view.mask].any()


@given(seeds, st.sampled_from([4.0, 50.0, 100e3]))
def test_depth_and_normal_of_a_tilted_plate_are_its_planes(
    make_scene, make_state, make_plate, seed, distance_m
):
    scene = make_scene({"plate": make_plate(2, 1, cells=3)}, focal_px=9 * distance_m)
    R = random_rotation(seed)
    t = np.array([0.3, -0.2, 1]) * [1, 1, distance_m]
    view = RayCaster(scene).view(make_state(t, R))
    normal = R[:, 2] * -np.sign(R[:, 2] @ t)
    expected = (normal @ t) / (directions(scene.camera) @ normal)
    np.testing.assert_allclose(view.depth_m[view.mask], expected[view.box.slices][view.mask], rtol=1e-7)
    np.testing.assert_allclose(
        view.normal_cam[view.mask], np.broadcast_to(normal, (view.mask.sum(), 3)), atol=1e-6
    )


@given(seeds)
def test_a_box_covers_the_hull_of_its_corners(make_scene, make_state, seed):
    box = trimesh.creation.box((3, 1, 0.5))
    scene = make_scene({"box": box})
    R, t = random_rotation(seed), np.array([0.2, 0.1, 5.0])
    view = RayCaster(scene).view(make_state(t, R))
    corners_px = scene.camera.project(box.vertices @ R.T + t)
    hull = ConvexHull(corners_px)
    u, v = np.meshgrid(np.arange(scene.camera.width_px), np.arange(scene.camera.height_px))
    beyond = (np.stack([u, v], -1) @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=-1)
    mask = full(view, scene.camera, view.mask, False)
    clear = np.abs(beyond) > 1e-5
    assert (mask == (beyond < 0))[clear].all()
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    np.testing.assert_allclose(view.whole_box_px, [*low, *(high - low)], rtol=1e-9)
    # view.box contains every pixel that the box touches.
    assert (np.array([view.box.x0, view.box.y0]) == np.floor(low + 0.5)).all()
    end = [view.box.x0 + view.box.width, view.box.y0 + view.box.height]
    assert (np.array(end) == np.floor(high + 0.5) + 1).all()


SHAPES = {
    "a triangle": trimesh.Trimesh([[0, 0, 0], [1, 0.2, 0], [0.3, 0.9, 0.1]], [[0, 1, 2]]),
    "a flat grid": trimesh.Trimesh(
        [[x, y, 0] for x in range(4) for y in range(4)],
        [[4 * x + y, 4 * x + y + 1, 4 * x + y + 5] for x in range(3) for y in range(3)],
    ),
    "a ball": trimesh.creation.icosphere(subdivisions=3),
    "a hollow star": trimesh.creation.annulus(0.4, 1.3, 0.5, sections=7),
}


@given(seeds)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_whole_box_is_around_all_vertices(make_scene, make_state, shape, seed):
    scene = make_scene({"part": SHAPES[shape]})
    R, t = random_rotation(seed), np.array([0.2, 0.1, 7.0])
    view = RayCaster(scene).view(make_state(t, R))
    px = scene.camera.project(SHAPES[shape].vertices @ R.T + t)
    low, high = px.min(axis=0), px.max(axis=0)
    np.testing.assert_allclose(view.whole_box_px, [*low, *(high - low)], rtol=0, atol=1e-10)


@pytest.mark.parametrize("distance_m", [2.5, 40.0, 20e3])
def test_a_faceted_sphere_lies_between_its_inscribed_and_circumscribed_spheres(
    make_scene, make_state, distance_m
):
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    inner = np.min(np.sum(mesh.face_normals * mesh.triangles[:, 0], axis=1))
    scene = make_scene({"ball": mesh}, focal_px=15 * distance_m)
    centre = np.array([0.5, -0.3, distance_m])
    sun = np.array([0.6, -0.64, -0.48])
    view = RayCaster(scene).view(make_state(centre, sun_body=sun))
    d = directions(scene.camera)[view.box.slices]
    unit = d / np.linalg.norm(d, axis=-1, keepdims=True)
    along = unit @ centre
    miss = np.linalg.norm(centre - along[..., None] * unit, axis=-1)
    assert view.mask[miss < inner].all()
    assert not view.mask[miss > 1.0].any()
    sure = miss < 0.95 * inner
    near = (along - np.sqrt(np.where(sure, 1 - miss**2, 0))) * unit[..., 2]
    far = (along - np.sqrt(np.where(sure, inner**2 - miss**2, 0))) * unit[..., 2]
    slack = 1e-7 * distance_m
    assert ((view.depth_m >= near - slack) & (view.depth_m <= far + slack))[sure].all()
    # A convex body casts no shadow on itself: a face is lit if it faces the Sun.
    turned = view.normal_cam @ sun
    clear = view.mask & (np.abs(turned) > 1e-6)
    assert (view.lit == (turned > 0))[clear].all()
    assert 0.2 < view.lit[view.mask].mean() < 0.9


def test_the_shadow_of_one_plate_on_another(make_scene, make_state, make_plate):
    scene = make_scene({"wall": make_plate(4, 3), "shade": make_plate(0.5, 0.4, (-1.01, 0.3, -2.0))})
    sun = np.array([-0.5, 0.25, -1.0])
    view = RayCaster(scene).view(make_state((0, 0, 8), sun_body=sun))
    x, y, _ = np.moveaxis(directions(scene.camera)[view.box.slices] * 8.0, -1, 0)
    # A point on the wall is in shadow if the ray to the Sun hits the shade, whose plane is 2 m nearer.
    in_shadow = (np.abs(x + 2 * sun[0] + 1.01) < 0.5) & (np.abs(y + 2 * sun[1] - 0.3) < 0.4)
    wall, shade = view.part_id == 0, view.part_id == 1
    assert (wall & in_shadow).sum() > 20
    assert (view.lit == ~in_shadow)[wall].all()
    assert shade.sum() > 20
    assert view.lit[shade].all()


def test_a_plate_lit_from_behind_is_dark_from_either_side(make_scene, make_state, make_plate):
    caster = RayCaster(make_scene({"plate": make_plate(1, 1)}))
    turned = np.diag([1.0, -1.0, -1.0])
    front = caster.view(make_state((0, 0, 4), sun_body=(0, 0, 1)))
    back = caster.view(make_state((0, 0, 4), turned, sun_body=(0, 0, 1)))
    assert (front.mask == back.mask).all()
    assert not front.lit.any()
    assert (back.lit == back.mask).all()
    assert (back.normal_cam[back.mask] == [0, 0, -1]).all()


@given(seeds)
def test_faces_edge_on_to_the_sun_are_dark(make_scene, make_state, seed):
    """A box whose axis points at the Sun: its sides are edge-on, whatever rounding makes of them."""
    R = random_rotation(seed)
    state = make_state(np.array([0.2, 0.1, 5.0]), R, sun_body=(0, 0, 1))
    scene = make_scene({"box": trimesh.creation.box((1, 1, 3))})
    view = RayCaster(scene).view(state)
    to_sun = full(view, scene.camera, view.normal_cam, np.nan) @ state.sun_direction_cam
    lit = full(view, scene.camera, view.lit, False)
    assert (lit == (to_sun > 0.5)).all()
    hits = RayCaster(scene).rays(state, directions(scene.camera).reshape(-1, 3))
    assert (hits.lit == lit.ravel()).mean() > 0.998


@given(seeds)
def test_keypoints_of_a_cube(make_scene, make_state, seed):
    half = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    centres = np.concatenate([np.eye(3), -np.eye(3)])
    points = np.concatenate([half, centres])
    scene = make_scene(
        {"cube": trimesh.creation.box((2, 2, 2))}, {f"T{i}": p for i, p in enumerate(points)}
    )
    R, t = random_rotation(seed), np.array([0.4, 0.3, 6.0])
    view = RayCaster(scene).view(make_state(t, R))
    to_camera = -R.T @ t - points
    # Each ±1 coordinate is a face that contains the point. The point is visible if one faces the camera.
    faces_camera = (np.sign(points) * to_camera > 0) & (np.abs(points) == 1)
    expected = np.where(faces_camera.any(axis=1), VISIBLE, OCCLUDED)
    assert view.keypoints_visibility.tolist() == expected.tolist()
    x, y, z = (points @ R.T + t).T
    np.testing.assert_allclose(view.keypoints_px[:, 0], 48 * x / z + 31.5, rtol=1e-12)
    np.testing.assert_allclose(view.keypoints_px[:, 1], 48 * y / z + 23.5, rtol=1e-12)


def test_the_keypoint_tolerance_scales_with_the_spacecraft(make_scene, make_state, make_plate):
    for size_m in (16.7, 1.67):
        depths = {f"T{i}": (0.1, 0.1, size_m / 16.7 * d) for i, d in enumerate((-0.5, 0, 0.054, 0.056))}
        scene = make_scene({"plate": make_plate(size_m / 2, size_m / 4)}, depths)
        view = RayCaster(scene).view(make_state((0, 0, 2 * size_m)))
        assert view.keypoints_visibility.tolist() == [VISIBLE, VISIBLE, VISIBLE, OCCLUDED]


def test_keypoints_outside_the_image_are_not_occluded(make_scene, make_state, make_plate):
    keypoints = {"T1": (0, 0, 1.0), "T2": (-4.5, 0, 1.0), "T3": (0, 0, -6.0), "T4": (-2.0, 0, -0.01)}
    scene = make_scene({"plate": make_plate(5, 1)}, keypoints)
    view = RayCaster(scene).view(make_state((0, 0, 5)))
    assert view.keypoints_visibility.tolist() == [OCCLUDED, NOT_IN_FRAME, NOT_IN_FRAME, VISIBLE]
    assert np.isnan(view.keypoints_px[2]).all()
    assert view.keypoints_px[1, 0] == pytest.approx(31.5 - 48 * 4.5 / 6)


def test_the_border_of_the_image_is_half_a_pixel_outside_the_outer_centres(
    make_scene, make_state, make_plate
):
    x = [(-0.5 - 31.5) / 48 + s for s in (-1e-6, 1e-6)] + [(63.5 - 31.5) / 48 + s for s in (-1e-6, 1e-6)]
    scene = make_scene({"plate": make_plate(0.1, 0.1)}, {f"T{i}": (s, 0, 0) for i, s in enumerate(x)})
    view = RayCaster(scene).view(make_state((0, 0, 1)))
    assert view.keypoints_visibility.tolist() == [NOT_IN_FRAME, VISIBLE, VISIBLE, NOT_IN_FRAME]
