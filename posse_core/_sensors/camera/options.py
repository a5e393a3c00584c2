"""Options of a camera beside the chaser's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from pydantic import Field, model_validator

from posse_core._plugins.options import Options
from posse_core._scenario.camera import CameraConfig
from posse_core._scenario.presets import with_preset
from posse_core._scenario.sensor import SensorConfig


class CameraOptions(Options):
    """A camera beside the chaser's: by default one like it."""

    camera: CameraConfig | None = Field(
        None,
        description="the camera's geometry, with the keys of the scenario's 'camera'; null for the same"
        " as the chaser's camera",
    )
    sensor: SensorConfig | None = Field(
        None,
        description="its image sensor, with the keys of the scenario's 'sensor'; null for the same as"
        " the chaser's",
    )

    @model_validator(mode="before")
    @classmethod
    def _named(cls, raw: Any) -> Any:
        """Fill in a published camera's keys."""
        if not isinstance(raw, Mapping) or not isinstance(raw.get("camera"), Mapping):
            return raw
        return with_preset({key: value for key, value in raw.items() if value is not None})

    @model_validator(mode="after")
    def _scaled(self) -> Self:
        if self.camera is None or self.camera.scale == 1:
            return self
        sensor = self.sensor and self.sensor.with_pixels_of(self.camera.scale**-2)
        return self.model_copy(update={"camera": self.camera.scaled(), "sensor": sensor})
