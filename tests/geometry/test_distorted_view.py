"""Labels with a distorting lens: mask, boxes, depth and keypoints against OpenCV and closed forms."""

import dataclasses

import numpy as np
import pytest
import trimesh
from by_opencv import flat_of, projected_px
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._evaluation.raster import depth_of_mesh
from posse_core._evaluation.raster import extent_px as referees_extent_px
from posse_core._geometry.outline import edges_of, extent_px
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._model.labels import NOT_IN_FRAME

BARREL = BrownConrady(-0.3, 0.08, 0.004, -0.003, 0.0)
PINCUSHION = BrownConrady(0.25, 0.05, -0.002, 0.005, 0.02)
RATIONAL = BrownConrady(0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02)
FISHEYE = Fisheye(-0.02, 0.01, -0.003, 0.0005)
LENSES = [BARREL, PINCUSHION, RATIONAL, FISHEYE]


@pytest.fixture
def lensed(make_scene):
    def make(distortion, meshes, keypoints=None, **size):
        scene = make_scene(meshes, keypoints, **size)
        return dataclasses.replace(
            scene, camera=dataclasses.replace(scene.camera, distortion=distortion)
        )

    return make


@pytest.mark.parametrize("distortion", LENSES)
@pytest.mark.parametrize("x_m", [0.0, 1.4, -2.2])
def test_a_plate_covers_the_pixels_whose_rays_meet_it(lensed, make_state, make_plate, distortion, x_m):
    scene = lensed(
        distortion, {"plate": make_plate(1.7, 0.9)}, width_px=160, height_px=120, focal_px=110
    )
    R = Rotation.from_euler("xyz", [0.4, -0.5, 0.3]).as_matrix()
    t = np.array([x_m, 0.4, 4.0])
    view = RayCaster(scene).view(make_state(tuple(t), R))
    uv = np.stack(np.meshgrid(np.arange(160.0), np.arange(120.0)), -1).reshape(-1, 2)
    rays = np.column_stack([flat_of(scene.camera, uv), np.ones(len(uv))])
    z = (R[:, 2] @ t) / (rays @ R[:, 2])
    point = (z[:, None] * rays - t) @ R
    hit = (z > 0) & (np.abs(point[:, 0]) <= 1.7) & (np.abs(point[:, 1]) <= 0.9)
    mask = np.zeros((120, 160), dtype=bool)
    mask[view.box.slices] = view.mask
    assert mask.any()
    assert np.array_equal(mask, hit.reshape(120, 160))
    depth = np.full((120, 160), np.nan)
    depth[view.box.slices] = view.depth_m
    np.testing.assert_allclose(depth.reshape(-1)[hit], z[hit], rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from(LENSES),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1, 1), st.floats(4.5, 9)),
    st.integers(0, 10**6),
)
def test_extents_are_those_of_densely_projected_edges(distortion, t, seed):
    box = trimesh.creation.box((2.6, 1.2, 0.8))
    camera = Camera(160, 120, 110.0, 110.0, 79.5, 59.5, 0.036, distortion=distortion)
    vertices = box.vertices @ Rotation.random(random_state=seed).as_matrix().T + t
    edges = edges_of(np.asarray(box.faces))
    assert len(edges) == 18
    low, high = extent_px(camera, vertices, edges)
    share = np.linspace(0, 1, 2001)[:, None]
    flat = vertices / vertices[:, 2:]
    curves = np.concatenate([flat[a] + share * (flat[b] - flat[a]) for a, b in edges])
    uv = projected_px(camera, curves)
    np.testing.assert_allclose(low, uv.min(axis=0), atol=1e-3)
    np.testing.assert_allclose(high, uv.max(axis=0), atol=1e-3)
    for ours, theirs in zip(
        (low, high), referees_extent_px(camera, vertices[np.asarray(box.faces)]), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=2e-3)


def test_the_box_contains_an_edge_that_bulges_beyond_its_corners(lensed, make_state, make_plate):
    scene = lensed(BARREL, {"plate": make_plate(1.5, 1.0)}, width_px=160, height_px=120, focal_px=110)
    view = RayCaster(scene).view(make_state((0, 0, 3.0)))
    corners = projected_px(
        scene.camera, np.array([[x, y, 3.0] for x in (-1.5, 1.5) for y in (-1.0, 1.0)])
    )
    middle = projected_px(scene.camera, np.array([[0.0, 1.0, 3.0]]))
    assert middle[0, 1] > corners[:, 1].max() + 2
    assert view.whole_box_px[1] + view.whole_box_px[3] >= middle[0, 1]
    assert view.box.y0 + view.box.height - 1 == np.floor(
        view.whole_box_px[1] + view.whole_box_px[3] + 0.5
    )


@pytest.mark.parametrize("distortion", LENSES)
def test_an_independent_rasteriser_agrees(lensed, make_state, distortion):
    ball = trimesh.creation.icosphere(3, radius=1.2)
    scene = lensed(distortion, {"ball": ball}, width_px=120, height_px=90, focal_px=75)
    view = RayCaster(scene).view(make_state((0.9, -0.5, 2.6)))
    depth = depth_of_mesh(scene.camera, np.add(ball.vertices, [0.9, -0.5, 2.6]), np.asarray(ball.faces))
    expected = np.full((90, 120), np.inf)
    expected[view.box.slices] = np.where(view.mask, view.depth_m, np.inf)
    assert np.array_equal(np.isfinite(depth), np.isfinite(expected))
    seen = np.isfinite(depth)
    np.testing.assert_allclose(depth[seen], expected[seen], rtol=1e-6)


def test_keypoints_agree_with_opencv_and_are_nan_beyond_the_lens(lensed, make_state, make_plate):
    points = {"near": (0.5, 0.3, 0.0), "edge": (1.9, 0.0, 0.0), "far": (9.0, 0.0, 0.0)}
    lens = BrownConrady(k1=-0.3)
    scene = lensed(lens, {"plate": make_plate(2, 1)}, points, width_px=160, height_px=120, focal_px=180)
    view = RayCaster(scene).view(make_state((0, 0, 5.0)))
    expected = projected_px(scene.camera, np.add([*points.values()], [0, 0, 5.0]))
    np.testing.assert_allclose(view.keypoints_px[:2], expected[:2], atol=1e-9)
    # Here OpenCV's polynomial has folded over and projects the point into the image.
    assert 0 < expected[2, 0] < 160
    assert np.isnan(view.keypoints_px[2]).all()
    assert view.keypoints_visibility[2] == NOT_IN_FRAME


def test_a_spacecraft_beyond_the_lens_has_no_whole_box_but_the_right_mask(
    lensed, make_state, make_plate
):
    """For a plate that extends beyond the lens's reach, the mask is that of the plate cut to the
    reach."""
    size = {"width_px": 80, "height_px": 60, "focal_px": 60}
    wide = lensed(BARREL, {"plate": make_plate(40, 0.5)}, **size)
    cut = lensed(BARREL, {"plate": make_plate(3.2, 0.5)}, **size)
    views = [RayCaster(scene).view(make_state((0, 0.3, 3.0))) for scene in (wide, cut)]
    assert np.isnan(views[0].whole_box_px).any()
    assert np.isfinite(views[1].whole_box_px).all()
    masks = []
    for view in views:
        mask = np.zeros((60, 80), dtype=bool)
        mask[view.box.slices] = view.mask
        masks.append(mask)
    assert masks[0].any()
    assert np.array_equal(*masks)
    assert views[0].silhouette_px >= views[1].silhouette_px > masks[0].sum() > 0
