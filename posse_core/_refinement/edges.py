"""Edges of an image and of drawings: where they are and which way they run.

Light, materials and what is painted on them change how bright a face is; where faces meet and end, they
change less. An edge is the product ∇I ∇Iᵀ of the gradient with itself (the structure tensor; Bigün and
Granlund 1987), which is the same for edges from dark to bright and from bright to dark. The product of
two such tensors, element by element, is the square of the cosine between the edges.
"""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._arrays import Float32Array
from posse_core._refinement.windows import smooth

EDGE_BLUR_PX = 2.0
"""Of edges that are compared."""
_SMOOTH_PX = 0.7
"""Blur before gradients are taken."""
_FAINT = np.float32(1e-3)
"""Gradients below this are none."""
_SURROUNDINGS_PX, _STRENGTH = 8.0, np.float32(0.01)
"""Standard deviation of the windows in which an edge is compared with others, and the strength of what
counts half where there are no others."""
_ROOT_2 = np.sqrt(2)


def edges(channels: Float32Array, blur_px: float) -> Float32Array:
    """The edges (h, w, 3) of channels (h, w, C): ∇I ∇Iᵀ summed over the channels, in proportion to the
    gradient and not to its square, and blurred.

    Its three numbers are those of x with x, of x with y times √2, and of y with y, so that products of
    tensors are products of vectors.
    """
    smoothed = smooth(channels, _SMOOTH_PX)
    x, y = (
        np.asarray(cv2.Sobel(smoothed, cv2.CV_32F, *axis, scale=1 / 8)).reshape(channels.shape)
        for axis in ((1, 0), (0, 1))
    )
    tensors = np.stack([x * x, np.float32(_ROOT_2) * x * y, y * y]).sum(axis=-1)
    strength = np.sqrt(np.linalg.norm(tensors, axis=0))
    found = np.moveaxis(tensors / np.maximum(strength, _FAINT), 0, -1)
    return smooth(np.ascontiguousarray(found), blur_px)


def turned_edges(found: Float32Array, turn_rad: float) -> Float32Array:
    """The same (h, w, 3) in an image that is turned from x to y."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turn = np.array(
        [
            [c * c, -_ROOT_2 * c * s, s * s],
            [_ROOT_2 * c * s, c * c - s * s, -_ROOT_2 * c * s],
            [s * s, _ROOT_2 * c * s, c * c],
        ]
    )
    return np.asarray(cv2.transform(found, turn), np.float32)


def evened(found: Float32Array) -> Float32Array:
    """Edges (h, w, 3) as shares of those that surround them: a bright one says no more than a faint one
    that stands out as much."""
    strength = np.asarray(np.linalg.norm(found, axis=-1), np.float32)
    around = smooth(strength, _SURROUNDINGS_PX)
    return np.asarray(found / (around + _STRENGTH)[..., None], np.float32)


def correlation(one: Float32Array, other: Float32Array) -> float:
    """-1 … 1, that of edges (N, 3) with others; 0 where either are the same everywhere."""
    a, b = (each - each.mean(axis=0, dtype=np.float64) for each in (one, other))
    size = np.sqrt(np.sum(a * a) * np.sum(b * b))
    return float(np.sum(a * b) / size) if size > 0 else 0.0
