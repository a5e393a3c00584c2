"""What is seen beside the spacecraft, and continued behind it."""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.studio import Drawn
from posse_core._refinement.windows import smooth

_BESIDE_PX = 2
"""How far beside the spacecraft pixels are compared."""
_EDGE_PX, _FAINT = 1.5, np.float32(0.01)
"""Where a background is continued behind the spacecraft: the blur of what is nearest, and the weight of
what is twice as far away."""
_KERNEL = np.ones((3, 3), np.uint8)


def near_pixels(drawn: Drawn, finer: int) -> BoolArray:
    """(h, w) pixels of the crop that are on the spacecraft or a little beside it."""
    return near_covered(binned(drawn.coverage, finer))


def near_covered(coverage: Float32Array) -> BoolArray:
    """The same where the spacecraft covers so much (h, w) of the crop's pixels."""
    on = (coverage > 0).astype(np.uint8)
    return np.asarray(cv2.dilate(on, _KERNEL, iterations=_BESIDE_PX) > 0)


def behind(drawn: Drawn, crop: Crop) -> Float32Array:
    """(h, w) linear brightness of the crop without the spacecraft: what is seen beside it, continued."""
    covered = cv2.dilate(binned(drawn.coverage, crop.scale.finer), _KERNEL, iterations=_BESIDE_PX)
    free = (covered < 1e-3).astype(np.float32)
    if not free.any():
        return np.zeros_like(crop.linear)
    return continued(crop.linear * free, free)


def with_background(drawn: Drawn, crop: Crop) -> Float32Array:
    """What is drawn, before what is seen beside the spacecraft, as it reaches behind it."""
    far = cv2.resize(behind(drawn, crop), drawn.bright.shape[::-1])
    return np.asarray(drawn.bright + (1 - drawn.coverage) * far, np.float32)


def continued(sums: Float32Array, weights: Float32Array) -> Float32Array:
    """An image (h, w) continued where its weights are 0, from what is nearest (push-pull: Gortler et al.
    1996, The Lumigraph).

    Args:
        sums: the image times its weights.
    """
    levels = [(smooth(sums, _EDGE_PX), smooth(weights, _EDGE_PX))]
    while min(levels[-1][0].shape) > 1:
        finer = levels[-1]
        levels.append((_float32(cv2.pyrDown(finer[0])), _float32(cv2.pyrDown(finer[1]))))
    filled = np.full_like(levels[-1][0], sums.sum() / weights.sum())
    for seen, weight in reversed(levels):
        coarser = _float32(cv2.resize(filled, seen.shape[::-1]))
        filled = (seen + _FAINT * coarser) / (weight + _FAINT)
    return filled


def _float32(image: AnyArray) -> Float32Array:
    return np.asarray(image, np.float32)
