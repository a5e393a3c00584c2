"""The camera in OpenCV axes (x right, y down, z forward): a pinhole, or one with a distorting lens."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.distortion import LARGEST_TANGENT, BrownConrady, Distortion

MOST_SIDE_PX: Final = 16384
"""Largest width and height of an image."""


@dataclass(frozen=True)
class Camera:
    """The intrinsics of a camera. The centre of the top-left pixel is (0, 0).

    Attributes:
        width_px, height_px: size of the image.
        fx_px, fy_px: focal lengths in pixels.
        cx_px, cy_px: principal point; the centre of the image is ((W − 1)/2, (H − 1)/2).
        sensor_width_m: physical width of the sensor; it gives the pixel pitch and the focal length.
        line_time_s: time from the exposure of one row to that of the next; 0 for a global shutter.
        distortion: distortion of the lens; None for a pinhole.

    Raises:
        ValueError: the distortion folds over inside the image, or the image reaches beyond 84 degrees
            from the axis of a distorting lens.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    sensor_width_m: float
    line_time_s: float = 0.0
    distortion: Distortion | None = None

    def __post_init__(self) -> None:
        if self.distortion is not None and np.isnan(self.rays(self.border_px())).any():
            if self.distortion.reach == LARGEST_TANGENT:
                raise ValueError(
                    f"the image reaches beyond {np.degrees(np.arctan(LARGEST_TANGENT)):.3g} degrees from"
                    " the axis, where lenses end here; use a narrower field of view"
                )
            raise ValueError(
                "the distortion folds over inside the image: it is one-to-one only up to"
                f" {np.degrees(np.arctan(self.distortion.reach)):.3g} degrees from the axis;"
                " use coefficients of a calibration that covers the corners, or a narrower field of view"
            )

    @property
    def matrix(self) -> FloatArray:
        """(3, 3) camera matrix K in pixels: u = K x / z."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    @property
    def distortion_coefficients(self) -> FloatArray:
        """Those of :attr:`distortion`, in OpenCV's order: (5,) k₁, k₂, p₁, p₂, k₃, or (8,) with k₄, k₅,
        k₆, or (4,) for a fisheye; five zeros for a pinhole."""
        return (self.distortion or BrownConrady()).coefficients

    @property
    def pixel_pitch_m(self) -> float:
        """Width of a pixel on the sensor, m."""
        return self.sensor_width_m / self.width_px

    @property
    def focal_length_m(self) -> float:
        """Distance between the pinhole and the sensor, m."""
        return self.fx_px * self.pixel_pitch_m

    @cached_property
    def stretch(self) -> tuple[float, float]:
        """Smallest and largest factor by which the lens stretches a short line anywhere in the image."""
        if self.distortion is None:
            return 1.0, 1.0
        u, v = np.linspace(-0.5, self.width_px - 0.5, 65), np.linspace(-0.5, self.height_px - 0.5, 65)
        rays = self.rays(np.stack(np.meshgrid(u, v), axis=-1))
        xx, xy, yy = self.distortion.jacobian(rays[..., 0], rays[..., 1])
        half = np.hypot((xx - yy) / 2, xy)
        return float(np.min((xx + yy) / 2 - half)), float(np.max((xx + yy) / 2 + half))

    @property
    def pixel_rad(self) -> float:
        """The largest angle that the width of a pixel subtends, rad."""
        return 1 / (self.fx_px * self.stretch[0])

    def row_after_s(self, v_px: FloatArray) -> FloatArray:
        """Time of a row's exposure relative to the frame's instant: vertical positions in pixels, of any
        shape → seconds.

        The frame's instant is that of the middle row. Positions above and below the image have the time
        of its first and last row.
        """
        middle_px = (self.height_px - 1) / 2
        return np.asarray(self.line_time_s * np.clip(v_px - middle_px, -middle_px, middle_px))

    def project(self, x_cam_m: FloatArray) -> FloatArray:
        """Project points: (..., 3) camera axes, m → (..., 2) image positions (u, v), px.

        The result is NaN where z ≤ 0 and beyond the reach of the distortion.
        """
        x_cam_m = np.asarray(x_cam_m, dtype=np.float64)
        z = x_cam_m[..., 2]
        z = np.where(z > 0, z, np.nan)
        if self.distortion is None:
            u = self.fx_px * x_cam_m[..., 0] / z + self.cx_px
            v = self.fy_px * x_cam_m[..., 1] / z + self.cy_px
        else:
            x, y = self.distortion.distort(x_cam_m[..., 0] / z, x_cam_m[..., 1] / z)
            u, v = self.fx_px * x + self.cx_px, self.fy_px * y + self.cy_px
        return np.stack([u, v], axis=-1)

    def rays(self, uv_px: FloatArray) -> FloatArray:
        """Directions through image positions: (..., 2) px → (..., 3) in camera axes with z = 1.

        The result is never NaN within the image. Outside it is NaN where no direction within the
        distortion's reach is projected.
        """
        uv_px = np.asarray(uv_px, dtype=np.float64)
        x = (uv_px[..., 0] - self.cx_px) / self.fx_px
        y = (uv_px[..., 1] - self.cy_px) / self.fy_px
        if self.distortion is not None:
            x, y = self.distortion.undistort(x, y)
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def project_jacobian(self, x_cam_m: FloatArray) -> FloatArray:
        """Derivative of the projection: (..., 3) camera axes, m, z > 0 → (..., 2, 3) pixels per
        metre."""
        x, y = x_cam_m[..., 0] / x_cam_m[..., 2], x_cam_m[..., 1] / x_cam_m[..., 2]
        one, zero = np.ones_like(x), np.zeros_like(x)
        xx, xy, yy = (one, zero, one) if self.distortion is None else self.distortion.jacobian(x, y)
        by_ray = np.stack([np.stack([one, zero, -x], -1), np.stack([zero, one, -y], -1)], -2)
        by_lens = np.stack(
            [self.fx_px * np.stack([xx, xy], -1), self.fy_px * np.stack([xy, yy], -1)], -2
        )
        return np.asarray(by_lens @ by_ray / x_cam_m[..., 2, None, None])

    def area_seen(self, uv_px: FloatArray) -> FloatArray:
        """Number of pixels of an undistorted image that fall into one pixel: (..., 2) positions, px →
        (...).

        It is the solid angle of the pixel divided by that of an undistorted pixel in the same direction;
        1 without distortion.
        """
        if self.distortion is None:
            return np.ones(np.shape(uv_px)[:-1])
        rays = self.rays(uv_px)
        xx, xy, yy = self.distortion.jacobian(rays[..., 0], rays[..., 1])
        return np.asarray(1 / (xx * yy - xy * xy))

    def border_px(self) -> FloatArray:
        """(N, 2) positions of all pixel corners on the border of the image."""
        u = np.arange(self.width_px + 1) - 0.5
        v = np.arange(self.height_px + 1) - 0.5
        return np.concatenate(
            [np.stack(np.broadcast_arrays(u, edge), -1) for edge in (v[0], v[-1])]
            + [np.stack(np.broadcast_arrays(edge, v), -1) for edge in (u[0], u[-1])]
        )


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
        """(rows, columns) of the box in an array that covers the box ``outer`` around it."""
        return replace(self, x0=self.x0 - outer.x0, y0=self.y0 - outer.y0).slices

    @property
    def is_empty(self) -> bool:
        """Whether the box contains no pixel."""
        return self.width <= 0 or self.height <= 0

    def grown(self, margin_px: int, camera: Camera) -> PixelBox:
        """The box with a margin around it, limited to the image; an empty box stays empty."""
        if self.is_empty:
            return self
        x0, y0 = max(self.x0 - margin_px, 0), max(self.y0 - margin_px, 0)
        x1 = min(self.x0 + self.width + margin_px, camera.width_px)
        y1 = min(self.y0 + self.height + margin_px, camera.height_px)
        return PixelBox(x0, y0, x1 - x0, y1 - y0)

    def within_rows(self, first_row: int, rows: int) -> PixelBox:
        """The part of the box within some rows of the image."""
        y0 = max(self.y0, first_row)
        y1 = min(self.y0 + self.height, first_row + rows)
        return PixelBox(self.x0, y0, self.width, max(0, y1 - y0))

    @classmethod
    def around(cls, boxes: Iterable[PixelBox]) -> PixelBox:
        """The smallest box that contains all the boxes; empty ones do not count."""
        full = [box for box in boxes if not box.is_empty]
        if not full:
            return cls(0, 0, 0, 0)
        x0, y0 = min(box.x0 for box in full), min(box.y0 for box in full)
        x1, y1 = max(box.x0 + box.width for box in full), max(box.y0 + box.height for box in full)
        return cls(x0, y0, x1 - x0, y1 - y0)

    def pixel_centres_px(self) -> FloatArray:
        """(height, width, 2) positions (u, v) of the pixels' centres."""
        u, v = np.meshgrid(
            np.arange(self.x0, self.x0 + self.width, dtype=np.float64),
            np.arange(self.y0, self.y0 + self.height, dtype=np.float64),
        )
        return np.stack([u, v], axis=-1)
