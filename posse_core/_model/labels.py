"""The result of the exact ray cast of a frame, and the labels that annotators make from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from posse_core._model.camera import PixelBox

NOT_IN_FRAME, OCCLUDED, VISIBLE = 0, 1, 2
"""Visibility of a keypoint, as in COCO: outside the image, inside but hidden, visible."""


@dataclass(frozen=True)
class View:
    """The target, and the bodies beside it, as the camera's rays hit them, with one ray through each
    pixel's centre.

    The arrays cover only :attr:`box`.

    Attributes:
        box: the pixels whose rays may hit a body; empty if all are outside the image. In a look about
            another body than the scene's target, those that may hit that body.
        part_id: (h, w) int16 index in ``scene.pieces``, which for the target is that in
            ``spacecraft.parts``; −1 where nothing is hit.
        triangle: (h, w) int32 index of the triangle, counted through the faces of ``scene.pieces``
            in order; −1 where nothing is hit.
        depth_m: (h, w) float32 planar z; NaN where nothing is hit.
        normal_cam: (h, w, 3) float32 geometric normal, on the camera's side, camera axes; NaN where
            nothing is hit.
        lit: (h, w) bool, whether the point faces the Sun's centre and no part is in between. Eclipses by
            the Earth are not considered.
        silhouette_px: number of pixels that the target would cover in an unbounded image without the
            other bodies.
        keypoints_px: (K, 2) image positions of the target's keypoints; NaN behind the camera.
        keypoints_visibility: (K,) int8, :data:`NOT_IN_FRAME`, :data:`OCCLUDED`, :data:`VISIBLE`.
        whole_box_px: (4,) x, y, width and height of the box around all of the target's vertices,
            also outside the image; NaN if a vertex is behind the camera.
        target_parts: number of the target's parts, which are the first of ``scene.pieces``.
    """

    box: PixelBox
    part_id: IntArray
    triangle: IntArray
    depth_m: Float32Array
    normal_cam: Float32Array
    lit: BoolArray
    silhouette_px: int
    keypoints_px: FloatArray
    keypoints_visibility: IntArray
    whole_box_px: FloatArray
    target_parts: int

    @property
    def mask(self) -> BoolArray:
        """(h, w) bool, whether the ray through the pixel's centre hits the target first."""
        return (self.part_id >= 0) & (self.part_id < self.target_parts)

    @property
    def hit(self) -> BoolArray:
        """(h, w) bool, whether the ray through the pixel's centre hits any body."""
        return self.part_id >= 0


@dataclass(frozen=True)
class Labels:
    """The labels of one annotator for one frame.

    Attributes:
        values: labels by key, of plain JSON types. In the label line they are listed under the
            annotator's name, except those of the core's annotators, which are fields of
            :class:`posse_core.LabelLine`.
        arrays: arrays by name, for the frame's file ``truth/NNNNNN.npz``.
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, AnyArray] = field(default_factory=dict)
