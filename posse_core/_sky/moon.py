"""The Moon's disc and its phase."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import Float32Array, FloatArray

RADIUS_M = 1_737_400.0
GEOMETRIC_ALBEDO_RGB: FloatArray = np.array([0.135, 0.120, 0.095])
"""(3,) 0.12 in V (Allen's Astrophysical Quantities, 4th ed., § 12.5), redder than the Sun."""


def radiance(
    rays: FloatArray,
    to_moon_m: FloatArray,
    moon_to_sun: FloatArray,
    sun_irradiance_rgb_w_m2: FloatArray,
) -> Float32Array:
    """Radiance of the Moon along rays, 0 outside its disc.

    Lommel–Seeliger shading, scaled so that the whole disc follows Allen's phase law,
    Δm = 0.026 |α| + 4·10⁻⁹ α⁴ (α in degrees). The maria are left out.

    Args:
        rays: (..., 3) unit vectors.
        to_moon_m: (3,) from the camera to the Moon, in the axes of the rays.
        moon_to_sun: (3,) unit vector, same axes.
        sun_irradiance_rgb_w_m2: (3,) irradiance by the Sun.

    Returns:
        (..., 3) W m⁻² sr⁻¹.
    """
    distance_m = float(np.linalg.norm(to_moon_m))
    ahead_m = rays @ to_moon_m
    root = ahead_m**2 - distance_m**2 + RADIUS_M**2
    hit = (root > 0) & (ahead_m > 0)
    way_m = ahead_m - np.sqrt(np.maximum(root, 0))
    normal = (way_m[..., None] * rays - to_moon_m) / RADIUS_M
    view = -np.einsum("...i,...i->...", normal, rays)
    sun = normal @ moon_to_sun
    cosine = float(np.clip(-(to_moon_m / distance_m) @ moon_to_sun, -1, 1))
    phase_rad = float(np.arccos(cosine))
    shape = np.where(hit & (sun > 0), 2 * sun / np.maximum(sun + view, 1e-6), 0)
    scale = GEOMETRIC_ALBEDO_RGB * sun_irradiance_rgb_w_m2 / np.pi * _phase_share(phase_rad)
    return np.asarray(shape[..., None] * scale, dtype=np.float32)


def _phase_share(phase_rad: float) -> float:
    """Allen's phase law divided by that of a Lommel–Seeliger sphere, 1 − sin(α/2) tan(α/2) ln
    cot(α/4)."""
    half = min(max(phase_rad, 1e-6), np.pi - 0.05) / 2
    sphere = 1 + np.sin(half) * np.tan(half) * np.log(np.tan(half / 2))
    degrees = np.rad2deg(2 * half)
    return float(10 ** (-0.4 * (0.026 * degrees + 4e-9 * degrees**4)) / sphere)
