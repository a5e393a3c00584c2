"""Motion blur against the ramp and the streak of uniform motion."""

import numpy as np
import pytest
from moving_plate import (
    DISTANCE_M,
    FOCAL_PX,
    PlateRenderer,
    camera,
    moving,
    plate,
)

from posse_core._geometry.raycast import RayCaster
from posse_core._scenario.sky import SkyConfig
from posse_core._simulator.light import CraftLight
from posse_core._sky.sky import Sky

MIDDLE = camera().matrix[:2, 2]
DARK = SkyConfig(earth=False, stars=None, sun_disc=False)
STARS = SkyConfig(earth=False, sun_disc=False)


def gathered(v_m_s: float, exposure_s: float, instants: int):
    scene, renderer = plate(), PlateRenderer(None)
    renderer.open(scene)
    sky, frame = Sky(DARK, scene.camera, 0), moving(v_m_s=(v_m_s, 0, 0))
    light = CraftLight(renderer, RayCaster(scene), sky, scene.camera, 0, "renderer")
    return light.gather(frame, exposure_s, instants, earthshine=frame)


@pytest.mark.parametrize("v_m_s", [6.0, -15.0])
def test_a_moving_edge_becomes_a_ramp_as_wide_as_its_motion(v_m_s):
    exposure_s = 0.05
    ramp_px = abs(v_m_s) * exposure_s * FOCAL_PX / DISTANCE_M
    craft = gathered(v_m_s, exposure_s, 64)
    line = craft.coverage[craft.box.height // 2].astype(float)
    pixels = craft.box.x0 + np.arange(craft.box.width)
    edge_px = MIDDLE[0] - FOCAL_PX * 2.03 / DISTANCE_M

    def integral(x):
        """The integral of the ramp, which rises from 0 to 1 around the edge."""
        begun, done = (np.clip((x - edge_px) / ramp_px + s, 0, None) ** 2 for s in (0.5, -0.5))
        return (begun - done) / 2 * ramp_px

    expected = integral(pixels + 0.5) - integral(pixels - 0.5)  # the ramp's mean over each pixel
    left = pixels < MIDDLE[0]
    np.testing.assert_allclose(line[left], expected[left], atol=0.01)


def test_blur_conserves_light_and_position():
    sharp, blurred = gathered(12.0, 0.05, 1), gathered(12.0, 0.05, 32)
    assert blurred.radiance_rgb.sum(dtype=float) == pytest.approx(
        sharp.radiance_rgb.sum(dtype=float), rel=1e-5
    )
    centroids = [
        (c.coverage.sum(axis=0) * (c.box.x0 + np.arange(c.box.width))).sum() / c.coverage.sum()
        for c in (sharp, blurred)
    ]
    assert centroids[0] == pytest.approx(centroids[1], abs=1e-3)
    assert blurred.box.width > sharp.box.width + 5


def test_a_star_becomes_a_streak_along_the_cameras_rotation_and_keeps_its_light():
    turn_rad_s, exposure_s = 0.8, 0.2
    frame = moving(omega_camera=(0, turn_rad_s, 0))
    sky = Sky(STARS, camera(), 0)
    sharp, streaked = sky.look(frame), sky.look(frame, exposure_s, 8)
    central = int(np.argmin(np.linalg.norm(sharp.points_px - MIDDLE, axis=1)))
    # The points of a star are recognised by their colour and irradiance, which no other star has.
    ratio = streaked.points_irradiance_rgb_w_m2 / sharp.points_irradiance_rgb_w_m2[central]
    least_points = FOCAL_PX * turn_rad_s * exposure_s / 0.2
    own = np.ptp(ratio, axis=1) < 1e-9 * ratio[:, 0]
    own &= np.abs(ratio[:, 0] * np.round(1 / ratio[:, 0]) - 1) < 1e-9
    own &= ratio[:, 0] < 1 / least_points
    streak = streaked.points_px[own]
    assert ratio[own].sum(axis=0) == pytest.approx([1, 1, 1], rel=1e-9)
    u0 = (sharp.points_px[central, 0] - MIDDLE[0]) / FOCAL_PX
    ends = FOCAL_PX * np.tan(np.arctan(u0) - turn_rad_s * exposure_s * np.array([-0.5, 0.5]))
    assert np.ptp(streak[:, 0]) == pytest.approx(np.ptp(ends), abs=0.25)
    assert np.hypot(*np.diff(streak, axis=0).T).max() < 0.25
