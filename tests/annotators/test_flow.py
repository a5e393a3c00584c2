"""Optical flow and scene flow against closed forms, OpenCV's projection and warping."""

from dataclasses import replace

import cuboid
import cv2
import numpy as np
import pytest
from by_opencv import projected_px
from hypothesis import given
from hypothesis import strategies as st
from moving_plate import DISTANCE_M, FOCAL_PX, HEIGHT, WIDTH, moving, plate
from scipy.spatial.transform import Rotation
from sequences import DURATION_S, look_at, posed

from posse_core._annotators.albedo import AlbedoAnnotator
from posse_core._annotators.flow import OpticalFlowAnnotator, SceneFlowAnnotator
from posse_core._model.camera import Camera
from posse_core._model.craft_state import Rates
from posse_core._model.distortion import BrownConrady, Fisheye
from posse_core._model.mount import Mount
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Material
from posse_core._plugins.options import NoOptions

AHEAD = np.array([0.0, 0.0, DISTANCE_M])
MIDDLE = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
FLOW_ERROR_PX = 1e-5  # single precision of a flow of 100 pixels
SCENE_FLOW_ERROR_M = 1e-6


def flows(scene, now, then):
    """The pixels (N, 2) of the mask, their flow (N, 2), its visibility (N,) and scene flow (N, 3)."""
    look = look_at(scene, now, then)
    optical = OpticalFlowAnnotator(NoOptions()).annotate(look)
    motion = SceneFlowAnnotator(NoOptions()).annotate(look)
    assert optical.values == motion.values == {"flow_duration_s": DURATION_S if then else None}
    view = look.view()
    flow_px, visible = optical.arrays["optical_flow_px"], optical.arrays["flow_visible"]
    flow_m = motion.arrays["scene_flow_m"]
    assert (flow_px.dtype, visible.dtype, flow_m.dtype) == (np.float32, np.bool_, np.float32)
    assert np.isnan(flow_px[~view.mask]).all()
    assert np.isnan(flow_m[~view.mask]).all()
    assert not visible[~view.mask].any()
    uv_px = view.box.pixel_centres_px()[view.mask]
    return uv_px, flow_px[view.mask], visible[view.mask], flow_m[view.mask]


def inside(uv_px, width=WIDTH, height=HEIGHT):
    return ((uv_px >= -0.5) & (uv_px < [width - 0.5, height - 0.5])).all(axis=1)


# A plate across the axis


@pytest.mark.parametrize("shift_m", [(0.7, -0.4, 0.0), (0.0, 3.0, 0.0), (0.013, 0.0, 0.0)])
def test_a_plate_that_slides_flows_by_f_dx_over_z(shift_m):
    now = moving()
    uv_px, flow_px, visible, flow_m = flows(plate(), now, posed(now, np.eye(3), AHEAD + shift_m))
    expected = FOCAL_PX * np.array(shift_m[:2]) / DISTANCE_M
    assert len(uv_px) > 1000
    assert np.abs(flow_px - expected).max() < FLOW_ERROR_PX
    assert np.abs(flow_m - shift_m).max() < SCENE_FLOW_ERROR_M
    assert np.array_equal(visible, inside(uv_px + expected))


@pytest.mark.parametrize("nearer_m", [4.0, -15.0])
def test_a_plate_that_comes_nearer_flows_from_the_middle(nearer_m):
    now = moving()
    then = posed(now, np.eye(3), AHEAD - [0, 0, nearer_m])
    uv_px, flow_px, visible, flow_m = flows(plate(), now, then)
    expected = (uv_px - MIDDLE) * (DISTANCE_M / (DISTANCE_M - nearer_m) - 1)
    assert np.abs(flow_px - expected).max() < FLOW_ERROR_PX
    assert np.abs(flow_m - [0, 0, -nearer_m]).max() < SCENE_FLOW_ERROR_M
    assert np.array_equal(visible, inside(uv_px + expected))


@pytest.mark.parametrize("angle_rad", [0.1, -2.0])
def test_a_turn_about_the_axis_turns_the_image(angle_rad):
    now = moving()
    R = Rotation.from_euler("z", angle_rad).as_matrix()
    uv_px, flow_px, visible, _ = flows(plate(), now, posed(now, R, AHEAD))
    expected = (uv_px - MIDDLE) @ (R[:2, :2] - np.eye(2)).T
    assert np.abs(flow_px - expected).max() < FLOW_ERROR_PX
    assert np.array_equal(visible, inside(uv_px + expected))


def test_a_turn_of_the_camera_is_a_homography():
    now = moving()
    R = Rotation.from_rotvec([0.05, -0.2, 0.3]).as_matrix()
    uv_px, flow_px, _, _ = flows(plate(), now, posed(now, R, R @ AHEAD))
    K = plate().camera.matrix
    there = np.column_stack([uv_px, np.ones(len(uv_px))]) @ (K @ R @ np.linalg.inv(K)).T
    assert np.abs(flow_px - (there[:, :2] / there[:, 2:] - uv_px)).max() < FLOW_ERROR_PX


def test_a_plate_behind_the_next_camera_has_no_flow_in_its_image():
    now = moving()
    _, flow_px, visible, flow_m = flows(plate(), now, posed(now, np.eye(3), -AHEAD))
    assert np.isnan(flow_px).all()
    assert not visible.any()
    assert np.abs(flow_m + 2 * AHEAD).max() < SCENE_FLOW_ERROR_M


def test_the_last_frame_of_a_sequence_has_no_flow():
    _, flow_px, visible, flow_m = flows(plate(), moving(), None)
    assert np.isnan(flow_px).all()
    assert np.isnan(flow_m).all()
    assert not visible.any()


def test_the_back_of_a_plate_that_turned_over_is_hidden_by_nothing():
    """Both sides of a face are visible, so a plate that turns over shows the same points."""
    now = moving()
    R = Rotation.from_euler("y", np.pi).as_matrix()
    uv_px, flow_px, visible, _ = flows(plate(), now, posed(now, R, AHEAD))
    mirrored = np.column_stack([2 * MIDDLE[0] - uv_px[:, 0], uv_px[:, 1]])
    assert np.abs(uv_px + flow_px - mirrored).max() < FLOW_ERROR_PX
    assert visible.all()


# Rolling shutter

LINE_S = 1e-3


def test_rows_are_at_their_times_in_both_frames():
    """A point at (u, v) moves by (w_x, w_y) pixels per second. Its row sees it at v LINE_S in this frame
    and at v' LINE_S in the next, so v' − v = w_y (T + (v' − v) LINE_S)."""
    speed_m_s = np.array([0.2, 0.3, 0.0])
    now = moving(v_m_s=tuple(speed_m_s))
    then = posed(now, np.eye(3), AHEAD + DURATION_S * speed_m_s)
    uv_px, flow_px, visible, flow_m = flows(plate(line_time_s=LINE_S), now, then)
    w_x, w_y = FOCAL_PX * speed_m_s[:2] / DISTANCE_M
    down = w_y * DURATION_S / (1 - w_y * LINE_S)
    later_s = DURATION_S + down * LINE_S
    seen = uv_px[:, 1] + down < HEIGHT - 1  # below the image, rows have the last one's time
    assert 500 < seen.sum() < len(seen)
    assert np.abs(flow_px - [w_x * later_s, down])[seen].max() < FLOW_ERROR_PX
    assert np.abs(flow_m - later_s * speed_m_s)[seen].max() < SCENE_FLOW_ERROR_M
    assert np.array_equal(visible[seen], inside(uv_px + flow_px)[seen])


def test_a_spinning_plate_has_the_angle_of_its_rows():
    """About the boresight, v' solves v' = y'(angle of the point at the time of row v')."""
    omega_rad_s = 0.4
    now = moving(omega_body=(0, 0, omega_rad_s))
    R = Rotation.from_euler("z", omega_rad_s * DURATION_S).as_matrix()
    uv_px, flow_px, _, _ = flows(
        plate(half_x_m=1.5, half_y_m=1.5, line_time_s=LINE_S), now, posed(now, R, AHEAD)
    )
    before, after = uv_px - MIDDLE, uv_px + flow_px - MIDDLE
    turn = omega_rad_s * (DURATION_S + LINE_S * (after[:, 1] - before[:, 1]))
    x = before[:, 0] * np.cos(turn) - before[:, 1] * np.sin(turn)
    y = before[:, 0] * np.sin(turn) + before[:, 1] * np.cos(turn)
    assert np.abs(after - np.stack([x, y], axis=1)).max() < FLOW_ERROR_PX


# Any pose, any lens

LENSES = [None, BrownConrady(-0.25, 0.08, 0.002, -0.003, -0.01), BrownConrady(k1=0.1), Fisheye()]
SIZE = (40, 30)
angles = st.tuples(*[st.floats(-3, 3)] * 3)
places = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(4, 9))


@given(st.sampled_from(LENSES), angles, places, angles, places)
def test_a_cuboid_flows_to_where_opencv_projects_it(lens, turn, place, next_turn, next_place):
    """Visibility in closed form: a point of a convex body is visible if its face looks at the camera."""
    camera = Camera(*SIZE, 38.0, 41.0, 20.3, 14.1, 0.036, distortion=lens)
    scene = Scene(cuboid.cuboid(), camera)
    R, R_next = (Rotation.from_rotvec(x).as_matrix() for x in (turn, next_turn))
    now = posed(moving(), R, np.array(place))
    look = look_at(scene, now, posed(now, R_next, np.array(next_place)))
    uv_px, flow_px, visible, flow_m = flows(scene, now, posed(now, R_next, np.array(next_place)))
    view = look.view()
    rays = camera.rays(uv_px)
    x_cam_m = rays * view.depth_m[view.mask, None].astype(float)
    x_body_m = (x_cam_m - place) @ R
    x_next_m = x_body_m @ R_next.T + next_place
    expected = projected_px(camera, x_next_m)
    assert np.abs(uv_px + flow_px - expected).max() < 1e-4
    assert np.abs(flow_m - (x_next_m - x_cam_m)).max() < 2e-6
    axis, sign = np.divmod(view.part_id[view.mask], 2)
    eye_body_m = -R_next.T @ next_place
    looks_on = eye_body_m[axis] * (2 * sign - 1) - cuboid.HALF[axis]
    # Not edge-on, not so near to an edge that a ray meets the other face within the tolerance, and not
    # on the image's border.
    from_edge_m = np.sort(cuboid.HALF - np.abs(x_body_m), axis=1)[:, 1]
    from_border_px = np.abs(np.abs(expected - np.array(SIZE) / 2 + 0.5) - np.array(SIZE) / 2)
    clear = (np.abs(looks_on) > 1e-2) & (from_edge_m > 1e-2) & (from_border_px > 1e-3).all(axis=1)
    seen = (looks_on > 0) & inside(expected, *SIZE)
    assert np.array_equal(visible[clear], seen[clear])


@given(angles, places, angles, places)
def test_the_next_frame_s_parts_and_depth_are_what_the_flow_leads_to(turn, place, next_turn, next_place):
    """Among four neighbouring pixels of one face, a visible point is of that face, and its inverse depth
    is interpolated exactly, because that of a plane is linear in a pinhole's image."""
    scene = Scene(cuboid.cuboid(), Camera(*SIZE, 38.0, 41.0, 20.3, 14.1, 0.036))
    R, R_next = (Rotation.from_rotvec(x).as_matrix() for x in (turn, next_turn))
    now, then = posed(moving(), R, np.array(place)), posed(moving(), R_next, np.array(next_place))
    look = look_at(scene, now, then)
    uv_px, flow_px, visible, flow_m = flows(scene, now, then)
    view, after = look.view(), look.next_frame.view()
    depth_m = (view.depth_m[view.mask] + flow_m[:, 2])[visible]
    there = (uv_px + flow_px)[visible] - [after.box.x0, after.box.y0]
    column, row = np.floor(there).astype(int).T
    height, width = after.part_id.shape
    between = (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1)
    column, row, (x, y) = column[between], row[between], (there - np.floor(there))[between].T
    corners = [(row + i, column + j) for i in (0, 1) for j in (0, 1)]
    parts = np.stack([after.part_id[corner] for corner in corners])
    one = (parts == parts[0]).all(axis=0) & (parts[0] >= 0)
    assert np.array_equal(parts[0, one], view.part_id[view.mask][visible][between][one])
    weights = np.stack([(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x])
    inverse = np.stack([1 / after.depth_m[corner].astype(float) for corner in corners])
    expected_m = 1 / np.sum(weights * inverse, axis=0)
    assert np.abs(depth_m[between] / expected_m - 1)[one].max(initial=0) < 1e-5


def test_a_camera_beside_the_chaser_s_has_its_own_flow():
    """Turned by a right angle about its axis, it sees what moves to the right move upward."""
    now, shift_m = moving(), np.array([0.4, 0.0, 0.0])
    mount = Mount(np.array([0.2, 0.0, 0.0]), Rotation.from_euler("z", 90, degrees=True).as_matrix())
    beside = look_at(plate(), now, posed(now, np.eye(3), AHEAD + shift_m), mount)
    arrays = OpticalFlowAnnotator(NoOptions()).annotate(beside).arrays
    expected = np.array([0.0, -shift_m[0] * FOCAL_PX / DISTANCE_M])
    assert np.abs(arrays["optical_flow_px"][beside.view().mask] - expected).max() < FLOW_ERROR_PX


def test_a_part_behind_another_is_not_visible():
    """A small plate, 1 m in front of a large one, hides of it what lies behind: a rectangle that moves
    with parallax."""
    large, small = plate(3.0, 3.0).spacecraft.parts[0], plate(0.5, 0.5).spacecraft.parts[0]
    small = replace(small, name="small", vertices_body_m=small.vertices_body_m - [0, 0, 1.0])
    scene = plate()
    craft = replace(scene.spacecraft, parts=(large, small))
    scene = replace(scene, spacecraft=craft)
    now, shift_m = moving(), np.array([3.0, 0.0, 0.0])
    look = look_at(scene, now, posed(now, np.eye(3), AHEAD + shift_m))
    part = look.view().part_id[look.view().mask]
    uv_px, flow_px, visible, _ = flows(scene, now, posed(now, np.eye(3), AHEAD + shift_m))
    there = uv_px + flow_px - MIDDLE
    # The small plate in the next image: 9 m away, from x = 2.5 m to 3.5 m.
    low, high = FOCAL_PX * np.array([[2.5, -0.5], [3.5, 0.5]]) / 9.0
    covered = ((there > low) & (there < high)).all(axis=1)
    assert 30 < (covered & (part == 0)).sum() < 200
    assert np.array_equal(visible, inside(uv_px + flow_px) & ~(covered & (part == 0)))


# Warping


@pytest.mark.parametrize("line_time_s", [0.0, LINE_S])
@pytest.mark.parametrize("lens", LENSES[:2])
def test_the_next_image_warped_back_by_the_flow_is_this_image(lens, line_time_s):
    """By OpenCV's bilinear interpolation, whose error is an eighth of the second difference."""
    v, u = np.mgrid[:64, :64] / 64 * 2 * np.pi
    waves = np.stack([np.sin(u) + np.cos(v), np.sin(2 * v), np.cos(u + v)], axis=-1)
    codes = np.round(160 + 45 * waves).astype(np.uint8)
    scene = plate(line_time_s=line_time_s)
    painted = replace(scene.spacecraft.parts[0], uv=np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]))
    craft = replace(
        scene.spacecraft,
        parts=(painted,),
        materials={"grey": Material("grey", base_color_texture=codes)},
    )
    scene = replace(scene, spacecraft=craft, camera=replace(scene.camera, distortion=lens))
    rates = Rates(
        np.array([0.1, 0.15, -0.05]), np.array([0.02, -0.01, 0.05]), np.array([0.003, 0.0, 0.01])
    )
    now = posed(moving(), Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix(), AHEAD, rates)
    then = now.after(DURATION_S)
    look = look_at(scene, now, then)

    def picture(at):
        labels, view = AlbedoAnnotator(NoOptions()).annotate(at), at.view()
        full = np.full((HEIGHT, WIDTH, 3), np.nan, dtype=np.float32)
        full[view.box.slices] = labels.arrays["base_color_rgb"]
        return full

    arrays, view = OpticalFlowAnnotator(NoOptions()).annotate(look).arrays, look.view()
    there = (view.box.pixel_centres_px() + arrays["optical_flow_px"]).astype(np.float32)
    this = picture(look)[view.box.slices]
    warped = cv2.remap(
        picture(look.next_frame), there, None, cv2.INTER_LINEAR, borderValue=(np.nan,) * 3
    )
    # Off the plate the next image is NaN, so a neighbour there makes the warped pixel NaN.
    compared = np.isfinite(warped).all(axis=-1) & arrays["flow_visible"]
    assert compared.mean() > 0.5
    residual = np.abs(warped - this)[compared]
    unwarped = np.abs(picture(look.next_frame)[view.box.slices] - this)[compared]
    assert residual.max() < 0.01
    assert np.nanmedian(unwarped) > 0.05
