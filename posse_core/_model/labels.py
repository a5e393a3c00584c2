"""What the exact ray-cast saw in a frame, and what annotators make of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from posse_core._model.camera import PixelBox

NOT_IN_FRAME, OCCLUDED, VISIBLE = 0, 1, 2
"""Visibility of a keypoint, as COCO has it: outside the image, inside but hidden, seen."""


@dataclass(frozen=True)
class View:
    """The spacecraft as the camera's rays meet it; one ray through each pixel's centre.

    Arrays cover :attr:`box` alone; outside it no ray meets the craft.

    Attributes:
        box: whole pixels that hold every ray that hits; empty when the craft is out of the image.
        part_id: (h, w) int16 place in ``spacecraft.parts``; −1 where nothing was hit.
        depth_m: (h, w) float32 planar z; NaN where nothing was hit.
        normal_cam: (h, w, 3) float32 geometric normal turned to the camera; NaN where nothing.
        lit: (h, w) bool: the Sun's centre sees the point (no part between, and it faces the Sun).
            Eclipse is not in it.
        silhouette_px: number of pixels that the craft would cover on an unbounded image.
        keypoints_px: (K, 2) projections; NaN behind the camera.
        keypoints_visibility: (K,) int8, :data:`NOT_IN_FRAME`, :data:`OCCLUDED`, :data:`VISIBLE`.
        whole_box_px: (4,) x, y, width, height that holds all of the craft's vertices, without
            regard to the image's border; NaN where a vertex is behind the camera.
    """

    box: PixelBox
    part_id: IntArray
    depth_m: Float32Array
    normal_cam: Float32Array
    lit: BoolArray
    silhouette_px: int
    keypoints_px: FloatArray
    keypoints_visibility: IntArray
    whole_box_px: FloatArray

    @property
    def mask(self) -> BoolArray:
        """(h, w) bool: the pixel's centre is on the craft."""
        return self.part_id >= 0


@dataclass(frozen=True)
class Labels:
    """What one annotator says of one frame.

    Attributes:
        values: label by key, of plain JSON types. In the frame's line they stand under the annotator's
            own name; those of the core's annotators are fields of
            :class:`posse_core.LabelLine`.
        arrays: merged into the frame's file of arrays (``truth/NNNNNN.npz``).
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, AnyArray] = field(default_factory=dict)
