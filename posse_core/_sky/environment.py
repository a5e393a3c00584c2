"""The sky as an environment map, for renderers."""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._model.scene import EnvironmentMap
from posse_core._sky.earth import EarthView

SHAPE = (64, 128)
"""Rows and columns."""
_SUBSAMPLES = 3


def environment_map(earth: EarthView) -> EnvironmentMap:
    """The Earth's radiance in all directions, camera axes.

    Every pixel is the mean over its solid angle, so the total light does not depend on the resolution.
    """
    n = _SUBSAMPLES
    rows, columns = SHAPE
    # Steps within a row are uniform in the cosine, so that every sample has the same solid angle.
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    steps = (np.arange(n) + 0.5) / n
    cosine = (edges[:-1, None] + np.diff(edges)[:, None] * steps).ravel()[:, None]
    sine = np.sqrt(1 - cosine**2)
    phi = 2 * np.pi * (np.arange(columns * n) + 0.5) / (columns * n) - np.pi
    up = np.broadcast_to(-cosine, (rows * n, columns * n))
    directions = np.stack([sine * np.sin(phi), up, sine * np.cos(phi)], axis=-1)
    light = earth.light(directions, np.pi / (rows * n))
    means = cv2.resize(light, (columns, rows), interpolation=cv2.INTER_AREA)
    return EnvironmentMap(np.asarray(means, dtype=np.float32))
