"""Skylight for a rasteriser: an environment map convolved with the lobes of rough and matt surfaces.

This is the split-sum approximation of Karis, "Real Shading in Unreal Engine 4" (SIGGRAPH 2013 course),
with exact sums: the lobe about each output direction is a row of weights over the texels of the map. A
sixteenth of a turn about the vertical takes both maps' columns to others, so the weights of a sixteenth
of the outputs serve all, and the convolution of a frame is one product of small matrices.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from posse_core import EnvironmentMap, Float32Array, FloatArray

LOBE_ROUGHNESS = (0.25, 0.5, 0.75, 1.0)
"""Perceptual roughness of the lobes. For a smaller roughness, the first lobe is blended with the map
itself."""
LOBE_HEIGHT = 24
MAP_HEIGHT = 32
TURNS = 16
"""Turns about the vertical that both maps' columns have in common."""
ALBEDO_SIZE = 32
ALBEDO_SAMPLES = 1024


def convolved(radiance_rgb: Float32Array) -> Float32Array:
    """Convolve a map with each lobe of ``LOBE_ROUGHNESS`` and with the cosine lobe.

    Args:
        radiance_rgb: (h, w, 3) as in :class:`posse_core.EnvironmentMap`.

    Returns:
        (5, 24, 48, 3): mean radiance over the lobe about each direction, W m⁻² sr⁻¹. The cosine lobe is
        the last; its value is the irradiance divided by π.
    """
    small = cv2.resize(radiance_rgb, (2 * MAP_HEIGHT, MAP_HEIGHT), interpolation=cv2.INTER_AREA)
    turned = [np.roll(small, -turn * (2 * MAP_HEIGHT // TURNS), axis=1) for turn in range(TURNS)]
    out = _weights() @ np.stack(turned, axis=2).astype(np.float32).reshape(-1, TURNS * 3)
    by_turn = out.reshape(len(LOBE_ROUGHNESS) + 1, LOBE_HEIGHT, -1, TURNS, 3).swapaxes(2, 3)
    return np.ascontiguousarray(by_turn).reshape(-1, LOBE_HEIGHT, 2 * LOBE_HEIGHT, 3)


def lobe_albedo() -> Float32Array:
    """(32, 32, 2) reflectance of a GGX lobe = F0 · [..., 0] + F90 · [..., 1].

    The row is the roughness and the column is n·v, both at texel centres (i + ½)/32.
    """
    axis = (np.arange(ALBEDO_SIZE) + 0.5) / ALBEDO_SIZE
    u1 = (np.arange(ALBEDO_SAMPLES) + 0.5) / ALBEDO_SAMPLES
    phi = 2 * np.pi * ((np.arange(ALBEDO_SAMPLES) * 0.618_033_988_749_895) % 1.0)
    out = np.empty((ALBEDO_SIZE, ALBEDO_SIZE, 2), dtype=np.float32)
    n_v = axis[:, None]
    for i, roughness in enumerate(axis):
        a2 = roughness**4
        n_h = np.sqrt((1 - u1) / (1 + (a2 - 1) * u1))
        h_x = np.sqrt(1 - n_h**2) * np.cos(phi)
        v_h = np.maximum(np.sqrt(1 - n_v**2) * h_x + n_v * n_h, 1e-6)
        n_l = 2 * v_h * n_h - n_v
        lit = n_l > 0
        n_l = np.maximum(n_l, 1e-6)
        masking = (
            2
            * n_l
            * n_v
            / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
        )
        share = np.where(lit, masking * v_h / (n_h * n_v), 0.0)
        fresnel = (1 - v_h) ** 5
        out[i, :, 0] = (share * (1 - fresnel)).mean(axis=1)
        out[i, :, 1] = (share * fresnel).mean(axis=1)
    return out


@cache
def _weights() -> Float32Array:
    """(lobes · rows · columns, texels) weights of the outputs in the first columns, which the turns take
    to all others; each row sums to 1."""
    theta, seen = _directions(MAP_HEIGHT)
    _, about = _directions(LOBE_HEIGHT)
    about = about.reshape(LOBE_HEIGHT, 2 * LOBE_HEIGHT, 3)[:, : 2 * LOBE_HEIGHT // TURNS].reshape(-1, 3)
    cosine = np.clip(about @ seen.T, -1.0, 1.0).astype(np.float32)
    weight = np.maximum(cosine, 0) * np.sin(theta).astype(np.float32)
    n_h2 = (1 + cosine) / 2  # for a view along the normal, h bisects n and l
    lobes = np.empty((len(LOBE_ROUGHNESS) + 1, *weight.shape), dtype=np.float32)
    for lobe, roughness in zip(lobes, LOBE_ROUGHNESS, strict=False):
        np.multiply(n_h2, np.float32(roughness**4) - 1, out=lobe)
        lobe += 1
        np.square(lobe, out=lobe)
        np.divide(weight, lobe, out=lobe)
    lobes[-1] = weight
    lobes /= lobes.sum(axis=2, keepdims=True)
    return lobes.reshape(-1, weight.shape[1])


def _directions(height: int) -> tuple[FloatArray, FloatArray]:
    """(texels,) polar angle and (texels, 3) direction of a map's texels, camera axes."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    return np.repeat(theta, 2 * height), EnvironmentMap.directions_cam(height).reshape(-1, 3)
