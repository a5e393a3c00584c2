"""The referee of masks and depths against a ray's slabs, and where a mesh passes the camera."""

import cuboid
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._evaluation.raster import RayMeeting, depth_of_mesh

FACES = np.concatenate([part.faces + 4 * i for i, part in enumerate(cuboid.cuboid().parts)])
VERTICES = np.concatenate([part.vertices_body_m for part in cuboid.cuboid().parts])


@given(st.integers(0, 10**6), st.floats(-6, 6), st.floats(-6, 6), st.floats(1.8, 60))
def test_a_cuboid_is_where_its_slabs_are(seed, x, y, z):
    R, t = Rotation.random(random_state=seed).as_matrix(), np.array([x, y, z])
    depth = depth_of_mesh(cuboid.CAMERA, VERTICES @ R.T + t, FACES)
    expected, _ = cuboid.slabs(R, t, cuboid.HALF)
    both = np.isfinite(depth) & np.isfinite(expected)
    assert (
        np.isfinite(depth) != np.isfinite(expected)
    ).sum() <= 1  # a ray along an edge may go either way
    assert np.allclose(depth[both], expected[both], rtol=1e-9, atol=0)


def test_from_within_every_pixel_meets_a_wall():
    """The camera is in the middle and looks along x: triangles reach behind it on all sides."""
    R = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    depth = depth_of_mesh(cuboid.CAMERA, VERTICES @ R.T, FACES)
    rays = cuboid.CAMERA.rays(np.stack(np.mgrid[:160, :120], axis=-1).transpose(1, 0, 2)) @ R
    expected = np.min(cuboid.HALF / np.abs(rays), axis=-1)
    assert np.allclose(depth, expected, rtol=1e-12)


def test_a_mesh_behind_the_camera_is_not_seen():
    assert np.isinf(depth_of_mesh(cuboid.CAMERA, VERTICES - [0, 0, 5], FACES)).all()


def test_many_triangles_are_taken_in_blocks():
    """A fan of 3000 thin triangles with overlapping boxes gives the disc that it fills."""
    angle = np.linspace(0, 2 * np.pi, 3001)
    rim = np.stack([np.cos(angle), np.sin(angle), np.full_like(angle, 4.0)], axis=1)
    vertices = np.concatenate([[[0.0, 0.0, 4.0]], rim])
    faces = np.stack([np.zeros(3000, int), np.arange(1, 3001), np.arange(2, 3002)], axis=1)
    depth = depth_of_mesh(cuboid.CAMERA, vertices, faces)
    v, u = np.mgrid[:120, :160]
    radius_px = np.hypot(u - 79.5, v - 59.5)
    assert np.allclose(depth[radius_px < 37.49], 4.0, rtol=1e-12)
    assert np.all(np.isinf(depth[radius_px > 37.5]))


@given(st.integers(0, 10**6), st.floats(-6, 6), st.floats(-6, 6), st.floats(-60, 60))
def test_rays_in_all_directions_meet_a_cuboid_where_its_slabs_are(seed, x, y, z):
    """From beside it, behind it, and from within."""
    rng = np.random.default_rng(seed)
    R, t = Rotation.random(random_state=seed).as_matrix(), np.array([x, y, z])
    rays = np.concatenate([rng.normal(size=(200, 3)), t + rng.normal(size=(200, 3))])
    lengths = RayMeeting((VERTICES @ R.T + t)[FACES]).lengths(rays)
    walls = np.stack([-cuboid.HALF, cuboid.HALF]) + t @ R
    enter, leave = np.sort(walls[:, None] / (rays @ R), axis=0)
    first, last = enter.max(axis=1), leave.min(axis=1)
    meets = (first < last) & (last > 0)
    expected = np.where(meets, np.where(first > 0, first, last), np.inf)
    both = np.isfinite(lengths) & np.isfinite(expected)
    assert (np.isfinite(lengths) != np.isfinite(expected)).sum() <= 1
    assert np.allclose(lengths[both], expected[both], rtol=1e-9, atol=0)
