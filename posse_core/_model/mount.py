"""Where a sensor is on the chaser."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from posse_core._arrays import FloatArray


@dataclass(frozen=True)
class Mount:
    """Place and attitude of a sensor relative to the chaser's camera.

    Attributes:
        position_m: (3,) the sensor's origin in camera axes.
        R_camera_from_sensor: (3, 3) rotation from the sensor's axes to the camera's.
    """

    position_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    R_camera_from_sensor: FloatArray = field(default_factory=lambda: np.eye(3))

    @property
    def is_none(self) -> bool:
        """Whether the sensor's origin and axes are the camera's."""
        return not self.position_m.any() and np.array_equal(self.R_camera_from_sensor, np.eye(3))
