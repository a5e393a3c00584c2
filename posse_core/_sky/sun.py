"""The Sun's disc in the image."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._model.bands import BAND_CENTRES_M
from posse_core._model.camera import Camera, PixelBox

MAX_SUBSAMPLES = 8
"""Maximum number of samples per pixel and axis, for the rim of a small disc."""


def box_of_disc(camera: Camera, direction_cam: FloatArray, angular_radius_rad: float) -> PixelBox:
    """Pixels that a disc in the sky may touch; empty if there are none.

    ``direction_cam`` is the (3,) unit vector to the centre of the disc, camera axes. The angular radius
    must be under 5 degrees.
    """
    empty = PixelBox(0, 0, 0, 0)
    w, h = camera.width_px - 0.5, camera.height_px - 0.5
    corners = camera.rays(np.array([[-0.5, -0.5], [w, -0.5], [-0.5, h], [w, h]]))
    widest_rad = float(np.max(np.arctan(np.hypot(corners[:, 0], corners[:, 1]))))
    if np.arccos(np.clip(direction_cam[2], -1, 1)) > widest_rad + angular_radius_rad:
        return empty
    u, v = camera.project(direction_cam)
    if np.isnan(u):  # the lens does not map the centre, but part of the disc may be in the image
        return PixelBox(0, 0, camera.width_px, camera.height_px)
    # A pinhole stretches by 1/cos² in the radial direction, and a little more at the outer rim.
    stretch = camera.stretch[1] / max(direction_cam[2] - np.sin(angular_radius_rad), 0.05) ** 2
    reach_u = camera.fx_px * angular_radius_rad * stretch + 1
    reach_v = camera.fy_px * angular_radius_rad * stretch + 1
    x0, x1 = max(0, int(np.floor(u - reach_u))), min(camera.width_px - 1, int(np.ceil(u + reach_u)))
    y0, y1 = max(0, int(np.floor(v - reach_v))), min(camera.height_px - 1, int(np.ceil(v + reach_v)))
    return PixelBox(x0, y0, x1 - x0 + 1, y1 - y0 + 1) if x1 >= x0 and y1 >= y0 else empty


def subpixel_rays(camera: Camera, box: PixelBox) -> FloatArray:
    """(h, w, n², 3) unit vectors, camera axes, through a regular grid of n × n points in every pixel.

    The larger the box, the smaller the share of the disc's rim; n falls from MAX_SUBSAMPLES to 2.
    """
    n = int(np.clip(200 / max(box.width, box.height), 2, MAX_SUBSAMPLES))
    steps = (np.arange(n) + 0.5) / n - 0.5
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    rays = camera.rays(box.pixel_centres_px()[:, :, None, :] + offsets)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def limb_darkened(
    rays_cam: FloatArray,
    sun_direction_cam: FloatArray,
    angular_radius_rad: float,
    irradiance_rgb_w_m2: FloatArray,
) -> Float32Array:
    """Radiance of the Sun along unit rays: (..., 3) → (..., 3) W m⁻² sr⁻¹, 0 outside its disc.

    ``irradiance_rgb_w_m2`` (3,) is that of the whole disc. The limb darkening is I ∝ μ^α with
    α = −0.023 + 0.292 µm/λ (Hestroffer & Magnan 1998, A&A 333, 338), whose mean over the disc is
    2/(α + 2).
    """
    sine = np.linalg.norm(np.cross(rays_cam, sun_direction_cam), axis=-1)
    inside = (sine < np.sin(angular_radius_rad)) & (rays_cam @ sun_direction_cam > 0)
    mu = np.sqrt(np.clip(1 - (sine / np.sin(angular_radius_rad)) ** 2, 0, None))
    alpha = -0.023 + 0.292e-6 / np.array(BAND_CENTRES_M)
    centre = irradiance_rgb_w_m2 / (np.pi * np.sin(angular_radius_rad) ** 2) * (alpha + 2) / 2
    return np.asarray(inside[..., None] * centre * mu[..., None] ** alpha, dtype=np.float32)
