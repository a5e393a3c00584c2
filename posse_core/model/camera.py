"""The camera: a pinhole in OpenCV axes (x right, y down, z forward)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from posse_core.model.arrays import FloatArray


@dataclass(frozen=True)
class Camera:
    """Intrinsics. The centre of the top-left pixel is (0, 0).

    Attributes:
        width_px, height_px: image size.
        fx_px, fy_px: focal lengths in pixels.
        cx_px, cy_px: principal point; an image's middle is ((W − 1)/2, (H − 1)/2).
        sensor_width_m: physical width of the sensor; gives the pixel pitch and the focal length.
        line_time_s: from one row's exposure to the next one's; 0 for all rows at once.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    sensor_width_m: float
    line_time_s: float = 0.0

    @property
    def matrix(self) -> FloatArray:
        """(3, 3) camera matrix K in pixels: u = K x / z."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    @property
    def pixel_pitch_m(self) -> float:
        """Width of a pixel on the sensor."""
        return self.sensor_width_m / self.width_px

    @property
    def focal_length_m(self) -> float:
        """Distance between the pinhole and the sensor."""
        return self.fx_px * self.pixel_pitch_m

    def row_after_s(self, v_px: FloatArray) -> FloatArray:
        """When a row is exposed, against the frame's instant: any shape, pixels → seconds.

        The instant is the middle row's. Places above and below the image have its first and last
        row's time.
        """
        middle_px = (self.height_px - 1) / 2
        return np.asarray(self.line_time_s * np.clip(v_px - middle_px, -middle_px, middle_px))

    def project(self, x_cam_m: FloatArray) -> FloatArray:
        """Project points: (..., 3) metres in camera axes → (..., 2) pixels; NaN where z ≤ 0."""
        x_cam_m = np.asarray(x_cam_m, dtype=np.float64)
        z = x_cam_m[..., 2]
        z = np.where(z > 0, z, np.nan)
        u = self.fx_px * x_cam_m[..., 0] / z + self.cx_px
        v = self.fy_px * x_cam_m[..., 1] / z + self.cy_px
        return np.stack([u, v], axis=-1)

    def rays(self, uv_px: FloatArray) -> FloatArray:
        """Directions through pixels: (..., 2) pixels → (..., 3) in camera axes with z = 1."""
        uv_px = np.asarray(uv_px, dtype=np.float64)
        x = (uv_px[..., 0] - self.cx_px) / self.fx_px
        y = (uv_px[..., 1] - self.cy_px) / self.fy_px
        return np.stack([x, y, np.ones_like(x)], axis=-1)


@dataclass(frozen=True)
class PixelBox:
    """A rectangle of whole pixels: columns x0 … x0+width−1, rows y0 … y0+height−1."""

    x0: int
    y0: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """(rows, columns) of the box in an image array."""
        return slice(self.y0, self.y0 + self.height), slice(self.x0, self.x0 + self.width)

    def within(self, outer: PixelBox) -> tuple[slice, slice]:
        """(rows, columns) of the box in an array that covers a box around it."""
        return replace(self, x0=self.x0 - outer.x0, y0=self.y0 - outer.y0).slices

    @property
    def is_empty(self) -> bool:
        """No pixel is in the box."""
        return self.width <= 0 or self.height <= 0

    def grown(self, margin_px: int, camera: Camera) -> PixelBox:
        """The box with a margin around it, within the image; an empty one stays empty."""
        if self.is_empty:
            return self
        x0, y0 = max(self.x0 - margin_px, 0), max(self.y0 - margin_px, 0)
        x1 = min(self.x0 + self.width + margin_px, camera.width_px)
        y1 = min(self.y0 + self.height + margin_px, camera.height_px)
        return PixelBox(x0, y0, x1 - x0, y1 - y0)

    def within_rows(self, first_row: int, rows: int) -> PixelBox:
        """The part of the box in some rows of the image."""
        y0 = max(self.y0, first_row)
        y1 = min(self.y0 + self.height, first_row + rows)
        return PixelBox(self.x0, y0, self.width, max(0, y1 - y0))

    @classmethod
    def around(cls, boxes: Iterable[PixelBox]) -> PixelBox:
        """The smallest box that holds all of some boxes; empty ones do not count."""
        full = [box for box in boxes if not box.is_empty]
        if not full:
            return cls(0, 0, 0, 0)
        x0, y0 = min(box.x0 for box in full), min(box.y0 for box in full)
        x1, y1 = max(box.x0 + box.width for box in full), max(box.y0 + box.height for box in full)
        return cls(x0, y0, x1 - x0, y1 - y0)

    def pixel_centres_px(self) -> FloatArray:
        """(height, width, 2) pixel coordinates (u, v) of the centres."""
        u, v = np.meshgrid(
            np.arange(self.x0, self.x0 + self.width, dtype=np.float64),
            np.arange(self.y0, self.y0 + self.height, dtype=np.float64),
        )
        return np.stack([u, v], axis=-1)
