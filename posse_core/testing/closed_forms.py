"""Closed forms that rendered images are compared with."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.camera import Camera
from posse_core._model.scene import FrameState

__all__ = ["directions", "disc_share", "lambertian_sphere", "polygon_area_and_centroid"]


def directions(height: int) -> FloatArray:
    """(height, 2·height, 3) directions of an environment map's pixels, camera axes."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = np.pi * (np.arange(2 * height) + 0.5) / height - np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(theta) * np.sin(phi), -np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)


def disc_share(x: FloatArray) -> FloatArray:
    """Share of the unit disc's area to the left of the line at ``x`` (any shape): −1 → 0, 1 → 1."""
    x = np.clip(x, -1.0, 1.0)
    return np.asarray(0.5 + (np.arcsin(x) + x * np.sqrt(1 - x**2)) / np.pi)


def lambertian_sphere(camera: Camera, frame: FrameState, radius_m: float, fine: int = 6) -> FloatArray:
    """(H, W, 3) radiance of a white Lambertian sphere at the origin of the body axes, E/π cos θ,
    averaged over the square of ``fine`` rays per pixel."""
    u = (np.arange(fine * camera.width_px) + 0.5) / fine - 0.5
    v = (np.arange(fine * camera.height_px) + 0.5) / fine - 0.5
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    along = rays @ frame.craft.t_body_cam_m
    inside = along**2 - frame.craft.range_m**2 + radius_m**2
    hits = rays * (along - np.sqrt(np.maximum(inside, 0.0)))[..., None]
    normals = (hits - frame.craft.t_body_cam_m) / radius_m
    cosine = np.where(inside > 0, np.maximum(normals @ frame.craft.sun_direction_cam, 0.0), 0.0)
    mean = cosine.reshape(camera.height_px, fine, camera.width_px, fine).mean(axis=(1, 3))
    return np.asarray(mean[..., None] * frame.craft.sun_irradiance_rgb_w_m2 / np.pi)


def polygon_area_and_centroid(corners: FloatArray) -> tuple[float, FloatArray]:
    """Area and centroid (2,) of a simple polygon (n, 2)."""
    a, b = corners, np.roll(corners, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    return abs(float(area)), ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
