"""What the page carries of a frame beside its labels: image, depth and readings, made small."""

from __future__ import annotations

from typing import Any

from posse_core._dataset.dataset import Dataset
from posse_core._view.coding import coded_image, coded_map
from posse_core._view.readings import reading_previews


def preview(dataset: Dataset, i: int) -> dict[str, Any]:
    """What the page shows of the frame at position ``i`` beside its labels.

    ``jpeg``: base64; ``depth``: :func:`coded_map` of its truth, or None; ``readings``: those of sensors.

    Raises:
        InputError: a file of the frame is missing or damaged.
    """
    depth_m = dataset.truth(i).get("depth_m")
    return {
        "jpeg": coded_image(dataset.image(i)),
        "depth": None if depth_m is None else coded_map(depth_m),
        "readings": reading_previews(dataset, i),
    }
