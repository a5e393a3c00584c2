"""What an export says of an image, in the form of a dataset's own labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posse_core._arrays import BoolArray, FloatArray
from posse_core._model.label_line import BodyLabels


@dataclass(frozen=True)
class ExportedBody:
    """What an export says of one body of an image.

    Attributes:
        labels: those that it has.
        mask: (H, W) bool, if it has masks as arrays.
        name: of a body beside the target, if the export tells it.
    """

    labels: BodyLabels
    mask: BoolArray | None = None
    name: str | None = None


@dataclass(frozen=True)
class ExportedImage:
    """What an export says of an image.

    Attributes:
        image: its file in the dataset.
        bodies: in the order of the export.
        is_named: whether it tells the names of bodies beside the target.
        depth_m: (H, W), NaN without depth, if it has depths.
        depth_step_m: resolution of the depth.
    """

    image: str
    bodies: Sequence[ExportedBody]
    is_named: bool = False
    depth_m: FloatArray | None = None
    depth_step_m: float = 0.0
