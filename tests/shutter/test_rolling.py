"""Labels and images of a rolling shutter against the closed form of a moving edge."""

import numpy as np
import pytest
from moving_plate import DISTANCE_M, FOCAL_PX, HEIGHT, PlateRenderer, camera, moving, plate
from scipy.optimize import brentq

from posse_core._geometry.raycast import RayCaster
from posse_core._scenario.sky import SkyConfig
from posse_core._simulator.light import CraftLight
from posse_core._sky.sky import Sky

LINE_S = 1e-3
ROWS = np.arange(HEIGHT)
AFTER_S = (ROWS - (HEIGHT - 1) / 2) * LINE_S
MIDDLE = camera().matrix[:2, 2]
DARK = SkyConfig(earth=False, stars=None, sun_disc=False)


def left_edges(view) -> np.ndarray:
    """(H,) first column of the mask in each row, NaN if there is none."""
    edges = np.full(HEIGHT, np.nan)
    columns = np.argmax(view.mask, axis=1).astype(float) + view.box.x0
    edges[view.box.slices[0]] = np.where(view.mask.any(axis=1), columns, np.nan)
    return edges


def sheared_edge_px(v_m_s: float) -> np.ndarray:
    """(H,) position of the left edge of a plate that slides to the right, at the time of each row."""
    return MIDDLE[0] + FOCAL_PX * (-2.03 + v_m_s * AFTER_S) / DISTANCE_M


@pytest.mark.parametrize("v_m_s", [20.0, -35.0])
def test_a_sliding_edge_is_sheared_by_its_speed(v_m_s):
    scene = plate(line_time_s=LINE_S)
    edges = left_edges(RayCaster(scene).view(moving(v_m_s=(v_m_s, 0, 0)).craft))
    seen = np.isfinite(edges)
    assert seen.sum() == 50
    off_px = edges - sheared_edge_px(v_m_s)
    assert np.all((off_px[seen] > -0.011) & (off_px[seen] < 1.011))
    assert np.ptp(edges[seen]) >= abs(v_m_s) * 50 * LINE_S * FOCAL_PX / DISTANCE_M - 2


@pytest.mark.parametrize("turning", ["body", "camera"])
def test_a_spinning_edge_bends(turning):
    """At the angle ωτ about the boresight the edge is x = (−a − y sin ωτ) / cos ωτ, with τ of the
    row."""
    omega = 2.0
    rates = {"omega_body": (0, 0, omega)} if turning == "body" else {"omega_camera": (0, 0, -omega)}
    view = RayCaster(plate(half_y_m=9.0, line_time_s=LINE_S)).view(moving(**rates).craft)
    y, angle = (ROWS - MIDDLE[1]) / FOCAL_PX, omega * AFTER_S
    expected = MIDDLE[0] + FOCAL_PX * (-2.03 / DISTANCE_M - y * np.sin(angle)) / np.cos(angle)
    off_px = left_edges(view) - expected
    assert np.all((off_px > -0.011) & (off_px < 1.011))
    bend_px = expected[0] + expected[-1] - 2 * expected[HEIGHT // 2]
    assert abs(bend_px) > 2


def test_a_keypoint_has_its_position_at_the_time_of_its_row():
    """Against the root τ for which the point's row at the time τ is the row that is exposed at τ."""
    v, omega = np.array([20.0, -8.0, 3.0]), np.array([0.3, -0.2, 1.5])
    scene = plate(line_time_s=LINE_S)
    view = RayCaster(scene).view(moving(v_m_s=tuple(v), omega_body=tuple(omega)).craft)

    def at(corner, after_s):
        rate = np.linalg.norm(omega)
        k, angle = omega / rate, rate * after_s
        turned = corner * np.cos(angle) + np.cross(k, corner) * np.sin(angle)
        turned = turned + k * (k @ corner) * (1 - np.cos(angle))
        return scene.camera.project(turned + [0, 0, DISTANCE_M] + after_s * v)

    for uv, corner in zip(view.keypoints_px, scene.spacecraft.keypoints_body_m.values(), strict=True):
        after_s = brentq(lambda t, c=corner: (at(c, t)[1] - MIDDLE[1]) * LINE_S - t, -1, 1, xtol=1e-15)
        assert uv == pytest.approx(at(corner, after_s), abs=1e-6)
    assert (view.keypoints_visibility == 2).all()
    # The mask extends from keypoint to keypoint.
    assert view.whole_box_px[0] == pytest.approx(view.keypoints_px[:, 0].min())
    columns = np.flatnonzero(view.mask.any(axis=0)) + view.box.x0
    assert columns[0] == pytest.approx(view.keypoints_px[:, 0].min(), abs=1.02)
    assert columns[-1] == pytest.approx(view.keypoints_px[:, 0].max(), abs=1.02)


def test_image_and_mask_have_the_same_edge():
    """The sum of a row's exact coverage gives the image's edge to a fraction of a pixel."""
    scene, v_m_s = plate(line_time_s=LINE_S), 30.0
    renderer = PlateRenderer(None)
    renderer.open(scene)
    geometry, frame = RayCaster(scene), moving(v_m_s=(v_m_s, 0, 0))
    sky = Sky(DARK, scene.camera, 0)
    light = CraftLight(renderer, geometry, sky, scene.camera, 0, "renderer")
    craft = light.gather(frame, exposure_s=0.0, instants=1, earthshine=frame)
    inner = craft.coverage.max(axis=1) == 1
    rows = ROWS[craft.box.slices[0]][inner]
    left_px = craft.box.x0 + np.argmax(craft.coverage[inner] == 1, axis=1)
    before = np.array([line[: np.argmax(line == 1)].sum() for line in craft.coverage[inner]])
    image_edge_px = left_px - before - 0.5
    expected_px = sheared_edge_px(v_m_s)[rows]
    assert np.abs(image_edge_px - expected_px).max() < 0.105
    mask_edge_px = left_edges(geometry.view(frame.craft))[rows]
    assert np.all((mask_edge_px - image_edge_px > -0.105) & (mask_edge_px - image_edge_px < 1.105))
    # The bands together cover the image once: nothing is rendered twice.
    assert renderer.rendered_px < 1.3 * craft.box.width * craft.box.height


def test_without_motion_a_rolling_shutter_is_a_global_one():
    rolling, instant = (RayCaster(plate(line_time_s=s)).view(moving().craft) for s in (LINE_S, 0.0))
    np.testing.assert_array_equal(rolling.depth_m, instant.depth_m)
    np.testing.assert_array_equal(rolling.keypoints_px, instant.keypoints_px)
    assert rolling.silhouette_px == instant.silhouette_px


def test_the_silhouette_counts_what_leaves_the_image_during_readout():
    scene = plate(half_y_m=9.0, line_time_s=LINE_S)
    view = RayCaster(scene).view(moving(v_m_s=(0.0, 0, 0), omega_body=(0, 0, 1e-9)).craft)
    assert view.silhouette_px == pytest.approx(4 * 2.03 * 9.0 * (FOCAL_PX / DISTANCE_M) ** 2, rel=0.02)


def test_each_row_shows_the_sky_at_its_time():
    frame, rolling = moving(omega_camera=(0, 0.2, 0.05)), camera(LINE_S)
    config = SkyConfig(stars=None)
    seen = Sky(config, rolling, 0).look(frame).radiance_rgb
    still = Sky(config, camera(), 0)
    for row in (3, 35, 68):
        expected = still.look(frame.after(AFTER_S[row])).radiance_rgb[row]
        # Half a moment corresponds to a tenth of a pixel.
        step = np.abs(np.diff(expected, axis=0)).max()
        np.testing.assert_allclose(seen[row], expected, atol=0.3 * step + 1e-3)
