"""Images, maps and numbers as text that a page carries."""

from __future__ import annotations

import base64
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray

WIDTH_PX = 384
"""Longer side of an image or a map in the page at most."""
JPEG_QUALITY = 75


def eight_bits(image: AnyArray) -> AnyArray:
    """An image of uint8 or uint16 as uint8."""
    return (image // 257).astype(np.uint8) if image.dtype == np.uint16 else image


def coded_image(image: AnyArray) -> str:
    """(H, W) or (H, W, 3) red-green-blue, uint8 or uint16 → JPEG, base64."""
    image = eight_bits(image)
    image = cv2.resize(image, _size(image, image), interpolation=cv2.INTER_AREA)
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return text(data)


def coded_map(values: AnyArray) -> dict[str, Any] | None:
    """(H, W), not finite where there is no value → the part with values, in 255 steps; None without any.

    ``png``: base64, 8 bits, 0 for none, 1 … 255 for ``low`` … ``high``; it covers the rectangle
    ``box`` [x, y, w, h] of whole pixels.
    """
    there = np.isfinite(values)
    rows, columns = np.nonzero(there)
    if not len(rows):
        return None
    x, y = int(columns.min()), int(rows.min())
    box = [x, y, int(columns.max()) - x + 1, int(rows.max()) - y + 1]
    low, high = float(values[there].min()), float(values[there].max())
    crop = np.where(there, values, low)[y : y + box[3], x : x + box[2]]
    share = (crop - low) / max(high - low, 1e-9)
    inside = there[y : y + box[3], x : x + box[2]]
    steps = np.where(inside, 1 + np.round(254 * share), 0).astype(np.uint8)
    small = cv2.resize(steps, _size(crop, values), interpolation=cv2.INTER_NEAREST)
    _, data = cv2.imencode(".png", small, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return {"png": text(data), "box": box, "low": low, "high": high}


def text(data: AnyArray) -> str:
    """The bytes of an array, base64."""
    return base64.b64encode(data.tobytes()).decode("ascii")


def _size(part: AnyArray, whole: AnyArray) -> tuple[int, int]:
    """Width and height of a part when the whole is made small."""
    scale = min(1.0, WIDTH_PX / max(whole.shape[:2]))
    return max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale))
