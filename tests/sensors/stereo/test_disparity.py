"""Disparity and visibility of plates against closed forms, with both shutters."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, Standpoint
from posse_core._model.camera import Camera
from posse_core._model.craft_state import AT_REST, BodyState, Rates
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE
from posse_core._model.mount import Mount
from posse_core._model.scene import Body, Scene
from posse_core._sensors.stereo.disparity import OFF_CRAFT, EyeLabels, eye_labels
from posse_core.testing import scenes
from posse_core.testing.stage import CLAY, WHITE, craft

BASELINE_M = 0.4
CAMERA = Camera(96, 72, 90.0, 84.0, 46.0, 37.0, 0.01)
"""Neither of square pixels nor central."""
ROLLING = replace(CAMERA, line_time_s=1e-3)
SHIFT = np.array([BASELINE_M, 0.0, 0.0])


def looks_at(
    scene: Scene, *, at=(0.0, 0.0, 6.0), R=scenes.FACING, rates: Rates = AT_REST
) -> tuple[Look, Look]:
    """The looks of the left and of the right eye."""
    state = scenes.frame(t_body_cam_m=at, sun_direction_body=(0.2, 0.3, 1.0), R_cam_from_body=R)
    state = replace(state, craft=replace(state.craft, rates=rates))
    caster = RayCaster(scene)
    right = Look(Standpoint(state, Mount(SHIFT), 1, "sensor right"), scene, caster.through)
    return right.from_camera, right


def labels_of(left: Look, right: Look) -> tuple[EyeLabels, EyeLabels]:
    camera = left.scene.camera
    return eye_labels(left, camera, BASELINE_M), eye_labels(right, camera, -BASELINE_M)


def plate(*, u_m=(1.013, 0, 0), v_m=(0, 0.807, 0), camera: Camera = CAMERA) -> Scene:
    return scenes.scene(
        scenes.rectangle("plate", "clay", u_m=u_m, v_m=v_m), materials=(CLAY,), camera=camera
    )


def centres_px(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    v, u = np.mgrid[: camera.height_px, : camera.width_px].astype(float)
    return u, v


def test_a_plate_that_faces_the_eyes_has_one_disparity():
    """f b/z in every pixel between the plate's edges, and nothing elsewhere, in both images."""
    left, right = labels_of(*looks_at(plate()))
    u, v = centres_px(CAMERA)
    for eye, x_m in ((left, 0.0), (right, BASELINE_M)):
        x = (u - CAMERA.cx_px) / CAMERA.fx_px * 6 + x_m
        y = (v - CAMERA.cy_px) / CAMERA.fy_px * 6
        on = (np.abs(x) < 1.013) & (np.abs(y) < 0.807)
        expected = np.where(on, 90.0 * BASELINE_M / 6, np.nan)
        np.testing.assert_allclose(eye.disparity_px, expected, rtol=1e-7)
        assert eye.disparity_px.dtype == np.float32
        np.testing.assert_array_equal(eye.visibility, np.where(on, VISIBLE, OFF_CRAFT))


def test_a_plate_may_be_a_body_of_its_own():
    """Two plates, one before the other, as two parts of one craft and as two bodies."""
    far = scenes.rectangle("far", "clay", u_m=(1.013, 0, 0), v_m=(0, 0.807, 0))
    near = scenes.rectangle("near", "clay", centre_m=(0.1, 0.2, 1.5), u_m=(0.31, 0, 0), v_m=(0, 0.27, 0))
    one = scenes.scene(far, near, materials=(CLAY,), camera=CAMERA)
    beside = scenes.scene(near, materials=(CLAY,), camera=CAMERA).spacecraft
    two = replace(scenes.scene(far, materials=(CLAY,), camera=CAMERA), others=(Body("near", beside),))
    looks = []
    for scene in (one, two):
        state = scenes.frame(t_body_cam_m=(0.0, 0.0, 6.0), sun_direction_body=(0.2, 0.3, 1.0))
        here = BodyState(state.craft.R_cam_from_body, state.craft.t_body_cam_m)
        others = (here,) * len(scene.others)
        state = replace(state, craft=replace(state.craft, others=others))
        right = Look(Standpoint(state, Mount(SHIFT), 1, "sensor right"), scene, RayCaster(scene).through)
        looks.append((right.from_camera, right))
    for whole, parted in zip(labels_of(*looks[0]), labels_of(*looks[1]), strict=True):
        np.testing.assert_allclose(parted.disparity_px, whole.disparity_px, rtol=1e-7)
        np.testing.assert_array_equal(parted.visibility, whole.visibility)
        assert (parted.visibility == OCCLUDED).any()


@given(st.tuples(*[st.floats(-0.9, 0.9)] * 3))
def test_the_disparity_of_a_plane_is_affine_in_the_image(turn):
    """A plane n·x = c in the left eye's axes has the disparity f b (n·r)/c along the ray r."""
    R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
    at = np.array([0.3, -0.1, 6.0])
    left, right = looks_at(plate(), at=tuple(at), R=R)
    rays = CAMERA.rays(np.stack(centres_px(CAMERA), axis=-1))
    for eye, origin in zip(labels_of(left, right), (np.zeros(3), SHIFT), strict=True):
        n = R[:, 2]
        expected = CAMERA.fx_px * BASELINE_M * (rays @ n) / (n @ (at - origin))
        shown = np.isfinite(eye.disparity_px)
        assert shown.sum() > 100
        np.testing.assert_allclose(eye.disparity_px[shown], expected[shown], rtol=2e-7)


def test_what_a_plate_in_front_hides_and_what_is_out_of_the_other_image():
    """A large wall 9 m away, and a strip 5 m away: similar triangles say which of the wall's points each
    eye sees."""
    scene = scenes.scene(
        scenes.rectangle("wall", "clay", u_m=(30, 0, 0), v_m=(0, 30, 0)),
        scenes.rectangle("strip", "white", centre_m=(0.15, 0, 4), u_m=(0.61, 0, 0), v_m=(0, 20, 0)),
        materials=(CLAY, WHITE),
        camera=CAMERA,
    )
    left, right = labels_of(*looks_at(scene, at=(0.0, 0.0, 9.0)))
    u, _ = centres_px(CAMERA)
    seen = set()
    for eye, x_m, other_x_m in ((left, 0.0, BASELINE_M), (right, BASELINE_M, 0.0)):
        ray = (u - CAMERA.cx_px) / CAMERA.fx_px
        strip = np.abs(x_m + 5 * ray - 0.15) < 0.61
        x = np.where(strip, x_m + 5 * ray, x_m + 9 * ray)
        z = np.where(strip, 5.0, 9.0)
        across = other_x_m + (x - other_x_m) * 5 / z
        hidden = ~strip & (np.abs(across - 0.15) < 0.61)
        u_other = CAMERA.fx_px * (x - other_x_m) / z + CAMERA.cx_px
        inside = (u_other >= -0.5) & (u_other < CAMERA.width_px - 0.5)
        expected = np.where(inside, np.where(hidden, OCCLUDED, VISIBLE), NOT_IN_FRAME)
        np.testing.assert_array_equal(eye.visibility, expected)
        np.testing.assert_allclose(eye.disparity_px, 90.0 * BASELINE_M / z, rtol=1e-7)
        seen |= set(np.unique(expected))
    assert seen == {NOT_IN_FRAME, OCCLUDED, VISIBLE}


def test_without_the_spacecraft_in_view_there_is_nothing():
    for eye in labels_of(*looks_at(plate(), at=(0.0, 0.0, -6.0))):
        assert np.isnan(eye.disparity_px).all()
        assert (eye.visibility == OFF_CRAFT).all()


def test_with_a_rolling_shutter_each_row_has_the_distance_of_its_instant():
    """A plate that fills the image comes nearer at 20 m/s: from row to row by 2 cm."""
    rates = Rates(np.array([0.0, 0.0, -20.0]), np.zeros(3), np.zeros(3))
    scene = plate(u_m=(30, 0, 0), v_m=(0, 30, 0), camera=ROLLING)
    _, v = centres_px(ROLLING)
    z_m = 6 - 20 * 1e-3 * (v - 35.5)
    for eye in labels_of(*looks_at(scene, rates=rates)):
        np.testing.assert_allclose(eye.disparity_px, 90.0 * BASELINE_M / z_m, rtol=1e-7)


@pytest.mark.parametrize("line_time_s", [0.0, 1e-3])
@pytest.mark.parametrize("turn", [(0.2, -0.3, 0.4), (-0.9, 0.4, 1.3)])
def test_a_point_is_in_the_other_image_in_the_same_row_a_disparity_away(line_time_s, turn):
    """The point of the spacecraft that a pixel shows is there at the row's instant, while spacecraft and
    chaser turn; and the other eye's ray there meets it, or a nearer one where it is hidden."""
    camera = Camera(288, 216, 270.0, 252.0, 139.0, 111.0, 0.01, line_time_s)
    scene = replace(craft(), camera=camera)
    rates = Rates(np.array([0.1, -0.2, 0.3]), np.array([0.3, 0.5, -1.0]), np.array([0.02, -0.03, 0.01]))
    R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
    eyes = looks_at(scene, at=(0.1, 0.2, 4.0), R=R, rates=rates)
    hidden_count = 0
    for mine, other, eye, sign in zip(eyes, eyes[::-1], labels_of(*eyes), (-1, 1), strict=True):
        rows, columns = np.nonzero(np.isfinite(eye.disparity_px))
        d_px = eye.disparity_px[rows, columns].astype(float)
        after_s = camera.row_after_s(rows.astype(float))
        point_m = mine.rays(camera.rays(np.stack([columns, rows], -1)), after_s=after_s).point_body_m
        expected_px = np.stack([columns + sign * d_px, rows], -1)
        found_px = camera.project(other.state.craft.in_camera(point_m, after_s))
        # Rates of the two eyes agree to first order: b (ω t)² is 6 µm here, or 4e-4 px.
        assert np.abs(found_px - expected_px).max() < (1e-3 if line_time_s else 3e-6)

        rays = camera.rays(expected_px)
        z_m = other.rays(rays, after_s=after_s).distance_m / np.linalg.norm(rays, axis=1)
        nearer_m = camera.fx_px * BASELINE_M / d_px - z_m
        hidden = eye.visibility[rows, columns] == OCCLUDED
        visible = eye.visibility[rows, columns] == VISIBLE
        assert (np.abs(nearer_m[visible]) < 1e-3).all()
        assert (nearer_m[hidden] > 1e-3).all()
        hidden_count += hidden.sum()
    assert hidden_count > 20


def test_with_a_global_shutter_both_eyes_have_the_pixels_of_their_masks():
    for turn in ((0.2, -0.3, 0.4), (0.6, 0.5, -2.0), (-0.9, 0.4, 1.3)):
        R = Rotation.from_rotvec(turn).as_matrix() @ scenes.FACING
        eyes = looks_at(replace(craft(), camera=CAMERA), at=(0.1, 0.2, 4.0), R=R)
        for look, eye in zip(eyes, labels_of(*eyes), strict=True):
            mask, view = np.zeros((72, 96), bool), look.view()
            mask[view.box.slices] = view.mask
            np.testing.assert_array_equal(np.isfinite(eye.disparity_px), mask)
            depth_m = view.depth_m[view.mask].astype(float)
            np.testing.assert_allclose(eye.disparity_px[mask], 90 * BASELINE_M / depth_m, rtol=2e-7)
