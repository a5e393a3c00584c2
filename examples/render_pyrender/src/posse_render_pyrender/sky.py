"""Light from the sky for a rasteriser: the sky as surfaces of some roughnesses reflect it.

This is the split-sum approximation of Karis, "Real Shading in Unreal Engine 4" (SIGGRAPH 2013 course):
the mean of the sky over a lobe, times the share of an even sky that the lobe reflects.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

import posse_core as posse

ROUGHNESS = (0.25, 0.5, 0.75, 1.0)
"""Of the lobes; the shader interpolates between them."""
ROWS, LOBE_ROWS = 64, 24
"""Of a layer, and of the maps that the lobes are computed from; each has twice as many columns."""
SAMPLES = 512


def layers(environment: posse.EnvironmentMap) -> posse.Float32Array:
    """(7 · 64, 128, 3): the sky itself, its mean over the lobe of each roughness about each direction,
    that over the cosine lobe, and :func:`_lobe_albedo`, one below another. Maps of the sky have the axes
    of the environment map."""
    sky = environment.radiance_rgb
    lobes = _weights() @ _resized(sky, LOBE_ROWS).reshape(-1, 3)
    maps = lobes.reshape(-1, LOBE_ROWS, 2 * LOBE_ROWS, 3)
    return np.concatenate([*(_resized(each, ROWS) for each in (sky, *maps)), _lobe_albedo()])


def _resized(sky: posse.Float32Array, rows: int) -> posse.Float32Array:
    return np.asarray(cv2.resize(sky, (2 * rows, rows), interpolation=cv2.INTER_AREA))


@cache
def _weights() -> posse.Float32Array:
    """(lobes · directions, directions); each row sums to 1."""
    theta = np.pi * (np.arange(LOBE_ROWS) + 0.5) / LOBE_ROWS
    phi = np.pi * (np.arange(2 * LOBE_ROWS) + 0.5) / LOBE_ROWS - np.pi
    theta, phi = (angle.ravel() for angle in np.meshgrid(theta, phi, indexing="ij"))
    about = np.stack([np.sin(theta) * np.sin(phi), -np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)
    cosine = about @ about.T
    lit = np.maximum(cosine, 0) * np.sin(theta)
    # Of a view along the normal, whose half vector makes half the angle with the normal.
    ggx = [lit / ((1 + cosine) / 2 * (r**4 - 1) + 1) ** 2 for r in ROUGHNESS]
    rows = np.concatenate([*ggx, lit])
    return np.asarray(rows / rows.sum(axis=1, keepdims=True), dtype=np.float32)


@cache
def _lobe_albedo() -> posse.Float32Array:
    """(64, 128, 3) share of an even sky that a GGX lobe reflects: F0 times the first channel, and F90
    times the second. The row is the roughness, the column the cosine between normal and view."""
    n_v = ((np.arange(2 * ROWS) + 0.5) / (2 * ROWS))[:, None]
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    turn = 2 * np.pi * (np.arange(SAMPLES) * 0.618_033_988_749_895 % 1)
    rows = []
    for roughness in (np.arange(ROWS) + 0.5) / ROWS:
        a2 = roughness**4
        n_h = np.sqrt((1 - share) / (1 + (a2 - 1) * share))  # half vectors as the lobe distributes them
        v_h = np.maximum(np.sqrt((1 - n_v**2) * (1 - n_h**2)) * np.cos(turn) + n_v * n_h, 1e-6)
        n_l = np.maximum(2 * v_h * n_h - n_v, 0)
        shadowed = n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2)
        reflected = 2 * n_l * v_h / (n_h * shadowed)
        edge = (1 - v_h) ** 5
        rows.append(
            [(reflected * (1 - edge)).mean(axis=1), (reflected * edge).mean(axis=1), 0 * n_v[:, 0]]
        )
    return np.moveaxis(np.array(rows, dtype=np.float32), 1, -1)
