"""Scenario keys of the sensors beside the chaser's camera."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from pydantic import Field, model_serializer, model_validator

from posse_core._frames import matrix_from_quaternion, matrix_from_rotation_vector, unit
from posse_core._model.mount import Mount
from posse_core._plugins.options import Options
from posse_core._scenario.component import ComponentChoice, gathered_options

MOST_READINGS: Final = 10_000
"""The most readings of a sensor in one frame."""
_LARGEST_NORM_ERROR = 1e-3


class MountConfig(Options):
    """Place and attitude of a sensor relative to the chaser's camera."""

    position_m: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="the sensor's origin in camera axes (x right, y down, z forward), m"
    )
    rotation_vector_deg: tuple[float, float, float] | None = Field(
        None,
        description="the rotation that turns the camera's axes into the sensor's: its axis, in camera"
        " axes, times its angle in degrees; null for none",
    )
    q_camera_from_sensor: tuple[float, float, float, float] | None = Field(
        None,
        description="the same rotation as a unit quaternion, scalar first, instead of"
        " rotation_vector_deg",
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> MountConfig:
        q = self.q_camera_from_sensor
        if q is not None and self.rotation_vector_deg is not None:
            raise ValueError("give rotation_vector_deg or q_camera_from_sensor, not both")
        if q is not None and abs(math.hypot(*q) - 1) > _LARGEST_NORM_ERROR:
            raise ValueError(f"q_camera_from_sensor has length {math.hypot(*q):.4g}, not 1")
        return self

    def mount(self) -> Mount:
        """The mount that these keys describe."""
        if self.q_camera_from_sensor is not None:
            R = matrix_from_quaternion(unit(np.array(self.q_camera_from_sensor)))
        else:
            R = matrix_from_rotation_vector(np.radians(self.rotation_vector_deg or (0.0, 0.0, 0.0)))
        return Mount(np.array(self.position_m), R)


class SensorChoice(ComponentChoice):
    """A sensor: ``type`` names the component, and its options stand beside ``mount`` and ``rate_hz``."""

    name: str = Field(
        alias="type", description="name of the component; 'posse describe sensor' lists them"
    )
    mount: MountConfig = Field(MountConfig(), description="where the sensor is on the chaser")
    rate_hz: float | None = Field(
        None,
        gt=0,
        description="readings per second, from the instant of each frame until the next one of its"
        " sequence; null for one reading at each frame",
    )

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, raw: Any) -> Any:
        """Keep the keys that every sensor has apart from the component's options."""
        return gathered_options(raw, cls.key(), "mount", "rate_hz")

    @model_serializer
    def _flatten(self) -> dict[str, Any]:
        return {
            self.key(): self.name,
            "mount": self.mount.model_dump(mode="json"),
            "rate_hz": self.rate_hz,
            **self.options,
        }

    def instants_s(self, duration_s: float) -> tuple[float, ...]:
        """Seconds from a frame's instant to that of each reading.

        Args:
            duration_s: time to the sequence's next frame.

        Raises:
            ValueError: there would be more than :data:`MOST_READINGS`.
        """
        if self.rate_hz is None:
            return (0.0,)
        # An instant that differs from the next frame's by rounding alone belongs to that frame.
        count = max(1, math.ceil(duration_s * self.rate_hz * (1 - 1e-12) - 1e-9))
        if count > MOST_READINGS:
            raise ValueError(
                f"{count} readings would be taken in the {duration_s:g} s until the next frame, at most"
                f" {MOST_READINGS} are possible; lower rate_hz, or take frames more often"
            )
        return tuple(k / self.rate_hz for k in range(count))
