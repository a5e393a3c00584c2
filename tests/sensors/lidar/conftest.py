"""A lidar before spacecraft made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import SensorLook, Standpoint
from posse_core._interfaces.sensor import SensorSetting
from posse_core._model.craft_state import Rates
from posse_core._model.labels import Labels
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._model.spacecraft import Material, Part
from posse_core._scenario.sensor import SensorConfig
from posse_core._sensors.lidar.lidar import LidarSensor
from posse_core._sensors.lidar.options import LidarOptions
from posse_core.testing import scenes

MATT = Material("matt", (0.4, 0.3, 0.2), specular=0.0)
EXACT: dict[str, Any] = {"shot": False, "receiver_e": 0.0, "range_m": 0.0}
"""Keys of ``noise`` for none."""


def dark(*_: object) -> Any:
    raise AssertionError("a lidar sends its own light")


@pytest.fixture(scope="session")
def sense() -> Callable[..., Reading]:
    """Returns a function that takes a reading of parts.

    Their body axes are turned so that +z is towards the sensor, +x to the right and +y up, unless
    ``R_cam_from_body`` says otherwise. Rates are those of :class:`posse_core.Rates`.
    """

    def take(
        parts: list[Part],
        options: dict[str, Any],
        *,
        t_m: tuple[float, float, float] = (0.0, 0.0, 50.0),
        R_cam_from_body: np.ndarray = scenes.FACING,
        sun_body: tuple[float, float, float] = (0.0, 0.0, -1.0),
        sun_fraction: float = 1.0,
        rates: tuple[Any, Any, Any] = ((0, 0, 0), (0, 0, 0), (0, 0, 0)),
        materials: tuple[Material, ...] = (MATT,),
        index: int = 0,
    ) -> Reading:
        scene = scenes.scene(*parts, materials=materials, camera=scenes.camera())
        state = scenes.frame(
            t_body_cam_m=t_m,
            sun_direction_body=sun_body,
            R_cam_from_body=R_cam_from_body,
            sun_fraction=sun_fraction,
        )
        craft = replace(state.craft, rates=Rates(*(np.array(rate, float) for rate in rates)))
        state = replace(state, index=index, craft=craft)
        sensor = LidarSensor(LidarOptions.model_validate({"formats": [], **options}))
        no_labels = SensorSetting("test", 7, scene, SensorConfig(), Mount(), lambda _: Labels())
        sensor.open(no_labels)
        caster = RayCaster(scene)
        stand = Standpoint(state, Mount(), 7, "sensor test")
        return sensor.sense(SensorLook(stand, scene, caster.through, dark))

    return take
