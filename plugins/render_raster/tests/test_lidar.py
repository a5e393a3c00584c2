"""A lidar in the red band sees a spacecraft as the renderer shows it with the Sun behind the camera."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.constants import c, h
from scipy.spatial.transform import Rotation

from posse_core import PixelBox, RenderRequest, Scene
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import SensorLook, Standpoint
from posse_core._interfaces.sensor import SensorSetting
from posse_core._model.labels import Labels
from posse_core._model.mount import Mount
from posse_core._plugins.loading import Plugins
from posse_core._scenario.sensor import SensorConfig
from posse_core.testing import scenes

DISTANCE_M = 2000.0
"""So far that the Sun's rays and the beams are parallel."""
KEYS = {
    "pattern": {
        "shape": "flash",
        "width_px": 128,
        "height_px": 96,
        "hfov_deg": 0.42,
        "rays_per_side": 5,
        "pulse_energy_j": 1.0,
    },
    "wavelength_m": 650e-9,
    "ranging": {"echo": "centroid"},
    "receiver": {"saturation_e": None},
    "noise": {"shot": False, "receiver_e": 0.0, "range_m": 0.0},
    "formats": [],
}


def no_light(*_: object) -> None:
    raise AssertionError("a lidar sends its own light")


@pytest.mark.parametrize("seed", [0, 1])
def test_what_returns_to_a_lidar_is_what_the_sun_shows_from_behind(opened, seed: int) -> None:
    """Textures, normal maps and lobes of every material of Aqua, part by part."""
    registry = Plugins([]).registry
    aqua = registry.create("scene", "aqua").build().welded(())
    R = Rotation.random(None, np.random.default_rng(seed)).as_matrix()
    state = scenes.frame(
        t_body_cam_m=(0.0, 0.0, DISTANCE_M),
        sun_direction_body=tuple(-R[2]),
        R_cam_from_body=R,
        sun_angular_radius_rad=1e-4,
    )
    lidar = registry.create("sensor", "lidar", registry.options("sensor", "lidar", KEYS))
    lidar.open(
        SensorSetting("", 0, Scene(aqua, scenes.camera()), SensorConfig(), Mount(), lambda _: Labels())
    )
    assert lidar.camera is not None
    scene = Scene(aqua, lidar.camera)
    caster = RayCaster(scene)
    stand = Standpoint(state, Mount(), 0, "lidar")
    arrays = lidar.sense(SensorLook(stand, scene, caster.through, no_light)).arrays

    shape = (lidar.camera.height_px, lidar.camera.width_px)
    electrons_per_j = 0.7 * 0.7 * 650e-9 / (h * c)
    sent_e = 1.0 / (shape[0] * shape[1]) * electrons_per_j * math.pi / 4 * 0.02**2
    returned = np.nan_to_num(arrays["intensity_e"]).reshape(shape) * DISTANCE_M**2 / sent_e
    request = RenderRequest(state.craft, PixelBox(0, 0, shape[1], shape[0]), None, seed=0)
    light = opened(scene, samples_per_axis=5).render(request)
    shown = light.radiance_rgb[..., 0] / state.craft.sun_irradiance_rgb_w_m2[0]

    view = caster.view(state.craft)
    part_id = np.full(shape, -1)
    part_id[view.box.slices] = view.part_id
    part_id[light.coverage < 0.999] = -1
    compared = 0
    for part in np.unique(part_id[part_id >= 0]):
        here = part_id == part
        if here.sum() > 100:
            assert returned[here].mean() == pytest.approx(shown[here].mean(), rel=0.03)
            compared += here.sum()
    assert compared > 1000
    whole = part_id >= 0
    assert returned[whole].sum() == pytest.approx(shown[whole].sum(), rel=0.01)
