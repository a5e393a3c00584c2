"""From a net's outputs to detections in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._detection.square import Square
from posse_core._interfaces.detector import Detection


def detections_from(
    boxes_px: AnyArray,
    scores: AnyArray,
    labels: AnyArray,
    square: Square,
    classes: Sequence[str],
    height_px: int,
    width_px: int,
) -> list[Detection]:
    """Detections of one image, best first; boxes are cut at its border.

    Args:
        boxes_px: (K, 4) x, y, width, height in the square; empty ones are left out.
        scores: (K,).
        labels: (K,) places in ``classes``; negative where there is none.
    """
    boxes = square.boxes_out(boxes_px)
    low = np.clip(boxes[:, :2], 0, [width_px, height_px])
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0, [width_px, height_px])
    whole = np.concatenate([low, high - low], axis=1)
    kept = (labels >= 0) & (scores > 0) & (whole[:, 2:] > 0).all(axis=1)
    order = np.argsort(-scores, kind="stable")
    return [Detection(classes[int(labels[i])], float(scores[i]), whole[i]) for i in order if kept[i]]
