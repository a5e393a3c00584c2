"""The sky is the same to the bit, however many threads draw it."""

import numpy as np

from posse_core._sky.clouds import make_clouds
from posse_core._sky.earth import Earth
from posse_core._sky.environment import environment_map
from posse_core._sky.ground import blue_marble
from posse_core._sky.picture import picture


def test_picture_and_map_of_a_sunlit_earth(monkeypatch, make_camera, make_state):
    camera, zenith = make_camera(), np.array([0.8, 0.3, 0.52])
    frame = make_state(
        r_camera_m=7.08e6 * zenith / np.linalg.norm(zenith), forward=np.array([-0.6, 0.7, 0.1])
    )
    view = Earth(blue_marble(), make_clouds(0)).seen(frame)
    drawn, maps = [], []
    for count in ("1", "2", "5"):
        monkeypatch.setenv("POSSE_THREADS", count)
        image = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
        for box, light in picture(view, camera, 0, camera.height_px):
            image[box.slices] += light
        drawn.append(image)
        maps.append(environment_map(view).radiance_rgb)
    for first, *others in (drawn, maps):
        assert first.max() > 1
        assert all(np.array_equal(first, other) for other in others)
