"""A frame's image and depth, made small enough to be carried in the page."""

from __future__ import annotations

import base64
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.dataset import Dataset

WIDTH_PX = 384
"""Longer side of a preview at most."""
JPEG_QUALITY = 75


def preview(dataset: Dataset, i: int) -> dict[str, Any]:
    """What the page shows of the frame at position ``i`` beside its labels.

    ``jpeg``: base64; ``depth``: :func:`coded_depth` of its truth, or None.

    Raises:
        InputError: a file of the frame is missing or damaged.
    """
    depth_m = dataset.truth(i).get("depth_m")
    return {
        "jpeg": _coded_image(dataset.image(i)),
        "depth": None if depth_m is None else coded_depth(depth_m),
    }


def _coded_image(image: AnyArray) -> str:
    """(H, W) or (H, W, 3) red-green-blue, uint8 or uint16."""
    if image.dtype == np.uint16:
        image = (image // 257).astype(np.uint8)
    image = cv2.resize(image, _size(image, image), interpolation=cv2.INTER_AREA)
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return _text(data)


def coded_depth(depth_m: AnyArray) -> dict[str, Any] | None:
    """(H, W) metres, NaN where none → the part that holds the craft, in 255 steps; None where none is.

    ``png``: base64, 8 bits, 0 for none, 1 … 255 for ``near_m`` … ``far_m``; it covers the rectangle
    ``box`` [x, y, w, h] of whole pixels.
    """
    rows, columns = np.nonzero(np.isfinite(depth_m))
    if not len(rows):
        return None
    x, y = int(columns.min()), int(rows.min())
    box = [x, y, int(columns.max()) - x + 1, int(rows.max()) - y + 1]
    crop = depth_m[y : y + box[3], x : x + box[2]]
    near_m, far_m = float(np.nanmin(crop)), float(np.nanmax(crop))
    share = (crop - near_m) / max(far_m - near_m, 1e-9)
    steps = np.where(np.isfinite(crop), 1 + np.round(254 * share), 0).astype(np.uint8)
    small = cv2.resize(steps, _size(crop, depth_m), interpolation=cv2.INTER_NEAREST)
    _, data = cv2.imencode(".png", small, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return {"png": _text(data), "box": box, "near_m": near_m, "far_m": far_m}


def _size(part: AnyArray, whole: AnyArray) -> tuple[int, int]:
    """Width and height of a part in a preview of the whole."""
    scale = min(1.0, WIDTH_PX / max(whole.shape[:2]))
    return max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale))


def _text(data: AnyArray) -> str:
    return base64.b64encode(data.tobytes()).decode("ascii")
