"""Grey values of images."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import AnyArray, Float32Array
from posse_core._errors import InputError

_GREY_WEIGHTS = (0.2126, 0.7152, 0.0722)  # ITU-R BT.709, for linear values


def to_grey(image: AnyArray) -> Float32Array:
    """Convert an image to grey values as a share of full scale.

    Args:
        image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16, linear in radiance.

    Returns:
        (H, W) float32, 0 … 1; the luminance of ITU-R BT.709 for colours.

    Raises:
        InputError: The array is not such an image.
    """
    full_scale = {"uint8": 255, "uint16": 65535}.get(image.dtype.name)
    if full_scale is None or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise InputError(
            f"an image of shape {image.shape} and type {image.dtype} is not supported; give grey or"
            " red-green-blue of 8 or 16 bit"
        )
    plane = image if image.ndim == 2 else image @ np.array(_GREY_WEIGHTS)
    return np.asarray(plane / full_scale, dtype=np.float32)
