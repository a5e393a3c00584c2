"""Scenario keys of the camera."""

from __future__ import annotations

import math

from pydantic import Field

from posse_core.model.camera import Camera
from posse_core.options import Options


class CameraConfig(Options):
    """A pinhole with square pixels and the principal point in the image's middle.

    The defaults are the thesis' Table 3.5.
    """

    width_px: int = Field(1280, ge=1, le=16384, description="image width, pixels")
    height_px: int = Field(960, ge=1, le=16384, description="image height, pixels")
    hfov_deg: float = Field(90.0, gt=0, lt=180, description="horizontal field of view, degrees")
    sensor_width_mm: float = Field(36.0, gt=0, description="width of the sensor, mm")
    line_time_s: float = Field(
        0.0,
        ge=0,
        description="time from one row's exposure to the next one's, top row first: a rolling shutter;"
        " 0 for a global one",
    )

    def camera(self) -> Camera:
        """The intrinsics in pixels and metres."""
        f_px = self.width_px / (2 * math.tan(math.radians(self.hfov_deg) / 2))
        return Camera(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=f_px,
            fy_px=f_px,
            cx_px=(self.width_px - 1) / 2,
            cy_px=(self.height_px - 1) / 2,
            sensor_width_m=self.sensor_width_mm * 1e-3,
            line_time_s=self.line_time_s,
        )
