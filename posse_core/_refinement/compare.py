"""Comparison of a crop with what would be seen at a pose."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, Float32Array, IntArray
from posse_core._refinement.background import behind, near_pixels, with_background
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.edges import EDGE_BLUR_PX, correlation, edges, evened
from posse_core._refinement.flow import by_pose, gradient, normals
from posse_core._refinement.light import Light
from posse_core._refinement.placement import Placement
from posse_core._refinement.registration import Registered, registered
from posse_core._refinement.studio import Drawn, Studio
from posse_core._refinement.windows import Windows, smooth

WINDOW_PX = 6.0
"""Standard deviation of the windows in which gains are fitted."""
_DETAIL_PX = 3.0
"""The same for windows of which the detail is judged,"""
_BLOCK_PX = 8
"""and the side of the blocks in which it is compared."""
_ALIKE = 0.05
"""Two drawings of the same look leave sums of squares that differ by about this share, as their samples
lie elsewhere."""
_GAINS = (0.0, 3.0)
"""Least and greatest gain."""
_NOISE = 4 / 255
"""Variations of what is drawn below this share of white say nothing."""
SHAPE_NOISE = 0.03
"""The same for coverage and normals."""
_BLURS_PX = (0.0, 0.35, 0.5, 0.7, 0.9, 1.2, 1.6)


@dataclass(frozen=True)
class Comparison:
    """A crop compared with what would be seen.

    Attributes:
        residual: (h, w) seen minus drawn.
        by_pose: (h, w, 6) derivative of what is drawn; see :func:`posse_core._refinement.flow.by_pose`.
        compared: (h, w) which pixels are compared.
        agreement: 0 … 1, how much of the image is explained.
    """

    residual: Float32Array
    by_pose: Float32Array
    compared: BoolArray
    agreement: float


class Comparer(ABC):
    """Compares a crop with what would be seen at poses near that of the crop."""

    @abstractmethod
    def compare(self, placement: Placement) -> Comparison:
        """Draw the spacecraft and compare."""


class LitComparer(Comparer):
    """Compares brightness, with light of a known direction."""

    def __init__(self, crop: Crop, studio: Studio, light: Light) -> None:
        self._crop, self._studio, self._light = crop, studio, light

    def compare(self, placement: Placement) -> Comparison:
        """Draw the spacecraft and compare."""
        return self.compared(self._drawn(placement), placement)

    def agreement(self, drawn: Drawn) -> float:
        """How well the crop agrees with what is drawn already."""
        finer = self._crop.scale.finer
        return self.agreement_of(binned(self._scene(drawn), finer), near_pixels(drawn, finer))

    def agreement_of(self, modelled: Float32Array, near: BoolArray) -> float:
        """How well the crop agrees with what would be seen (h, w), on the spacecraft or a little beside
        it (h, w)."""
        if self._studio.knows_materials:
            return _correlation(self._crop.seen, modelled, near)
        windows = Windows(near.astype(np.float32), WINDOW_PX)
        left = windows.explained(self._crop.seen, modelled[..., None], _NOISE, _GAINS).residual
        return share_explained(left, windows.variance(self._crop.seen), near, self._crop.beside(near))

    def registered(self, drawn: Drawn, placement: Placement) -> Registered:
        """Where what is drawn at a pose lies in the crop."""
        finer = self._crop.scale.finer
        modelled = binned(self._scene(drawn), finer)
        return registered(self._crop, modelled, near_pixels(drawn, finer), placement)

    def lead(self, placement: Placement, other: LitComparer, others: Placement) -> float:
        """By how many standard deviations the drawing of another comparer, at its pose, leaves more of
        what varies within a few pixels than this one's does at a pose.

        What is left squared is compared in blocks of pixels, whose differences count as independent of
        each other (the test of Vuong, Econometrica 57, 1989, for models that are not nested). To the
        deviation is added :data:`_ALIKE` of what the better one leaves.
        """
        crop, finer = self._crop, self._crop.scale.finer
        there = LitComparer(crop, other._studio, other._light)
        drawn = self._drawn(placement), there._drawn(others)
        near = near_pixels(drawn[0], finer) | near_pixels(drawn[1], finer)
        windows = Windows(near.astype(np.float32), _DETAIL_PX)
        scenes = (binned(scene, finer) for scene in (self._scene(drawn[0]), there._scene(drawn[1])))
        mine, theirs = (
            windows.explained(crop.seen, scene[..., None], _NOISE, _GAINS).residual for scene in scenes
        )
        block = blocks(near.shape, _BLOCK_PX)[near]
        left, others_left = (
            np.bincount(block, (each[near] ** 2).astype(np.float64)) for each in (mine, theirs)
        )
        more = others_left - left
        least = _ALIKE * min(left.sum(), others_left.sum())
        deviation = float(np.sqrt(np.sum(more**2) + least**2))
        return float(more.sum()) / deviation if deviation > 0 else 0.0

    def edge_correlation(self, placement: Placement) -> float:
        """0 … 1, how far the edges of the crop lie as those that are drawn: the geometric mean of the
        correlation with the edges of the shape, of which light may leave some out, and of that with the
        edges in this light, many of which may be the background's."""
        crop, finer, drawn = self._crop, self._crop.scale.finer, self._drawn(placement)
        facing = normals(drawn.depth_m, crop.camera, crop.drawn_box) * drawn.coverage[..., None]
        shape = edges(binned(np.dstack([drawn.coverage, facing]), finer), EDGE_BLUR_PX)
        in_light = evened(edges(binned(self._scene(drawn), finer)[..., None], EDGE_BLUR_PX))
        seen, near = evened(edges(crop.seen[..., None], EDGE_BLUR_PX)), near_pixels(drawn, finer)
        found = [max(0.0, correlation(seen[near], each[near])) for each in (shape, in_light)]
        return float(np.sqrt(np.prod(found)))

    def agreement_of_background(self, placement: Placement) -> float:
        """How well the crop agrees, where the spacecraft is drawn, with what is seen beside it alone."""
        crop, drawn = self._crop, self._drawn(placement)
        continued = crop.coded(behind(drawn, crop))
        return self.agreement_of(continued, near_pixels(drawn, crop.scale.finer))

    def _drawn(self, placement: Placement) -> Drawn:
        crop = self._crop
        return self._studio.draw(crop.scale.drawn, crop.drawn_box, placement, self._light.lights)

    def _scene(self, drawn: Drawn) -> Float32Array:
        """What is drawn before its background, as sharp and as coded as the crop."""
        blur_px = self._light.blur_px * self._crop.scale.drawn
        return self._crop.coded(smooth(with_background(drawn, self._crop), blur_px))

    def compared(self, drawn: Drawn, placement: Placement) -> Comparison:
        """The same for what is drawn already."""
        crop, finer = self._crop, self._crop.scale.finer
        blur_px, scene = self._light.blur_px * crop.scale.drawn, self._scene(drawn)
        seen, modelled = crop.seen, binned(scene, finer)
        near = near_pixels(drawn, finer)
        windows = Windows(near.astype(np.float32), WINDOW_PX)
        explained = windows.explained(seen, modelled[..., None], _NOISE, _GAINS)
        jacobian = by_pose(
            gradient(scene),
            drawn.depth_m,
            2 + int(np.ceil(2 * blur_px)),
            crop.camera,
            crop.drawn_box,
            placement.t_body_cam_m,
        )
        jacobian = explained.gains * binned(jacobian, finer)
        # A change that gains and offsets explain as well says nothing of the pose.
        columns = [windows.left_of(jacobian[..., k], modelled, _NOISE) for k in range(6)]
        jacobian = np.stack(columns, axis=-1)
        agreement = (
            _correlation(seen, modelled, near)
            if self._studio.knows_materials
            else share_explained(
                explained.residual, windows.variance(seen), near, self._crop.beside(near)
            )
        )
        return Comparison(explained.residual, jacobian, near, agreement)


class ShapeComparer(Comparer):
    """Compares outlines and creases, whatever light and materials are.

    The image is explained by coverage and normals, so by any light that Lambert's law knows and any
    colour that changes little within a window.
    """

    def __init__(self, crop: Crop, studio: Studio, blur_px: float) -> None:
        self._crop, self._studio, self._blur_px = crop, studio, blur_px

    def compare(self, placement: Placement) -> Comparison:
        """Draw the spacecraft and compare."""
        crop, finer = self._crop, self._crop.scale.finer
        blur_px = self._blur_px * crop.scale.drawn
        drawn = self._studio.shape(crop.scale.drawn, crop.drawn_box, placement)
        facing = normals(drawn.depth_m, crop.camera, crop.drawn_box)
        channels = [drawn.coverage, *(facing[..., k] * drawn.coverage for k in (0, 1))]
        channels = [smooth(np.ascontiguousarray(channel), blur_px) for channel in channels]
        near = near_pixels(drawn, finer)
        windows = Windows(near.astype(np.float32), WINDOW_PX)
        coarse = np.stack([binned(channel, finer) for channel in channels], axis=-1)
        explained = windows.explained(crop.seen, coarse, SHAPE_NOISE)
        gains = explained.gains.repeat(finer, axis=0).repeat(finer, axis=1)
        sides = [gradient(channel) for channel in channels]
        slopes = tuple(
            np.asarray(sum(gains[..., k] * side[axis] for k, side in enumerate(sides)), np.float32)
            for axis in (0, 1)
        )
        jacobian = by_pose(
            (slopes[0], slopes[1]),
            drawn.depth_m,
            3 + int(np.ceil(2 * blur_px)),
            crop.camera,
            crop.drawn_box,
            placement.t_body_cam_m,
        )
        # A bright edge says no more than a faint one that stands out as much from its surroundings.
        variance = windows.variance(crop.seen)
        share = 1 / np.sqrt(variance + np.float32(_NOISE**2))
        residual = explained.residual * share
        agreement = share_explained(residual, variance * share**2, near)
        return Comparison(residual, binned(jacobian, finer) * share[..., None], near, agreement)


def sharpest(drawn: Drawn, crop: Crop) -> float:
    """The blur, px of the image, with which what is drawn agrees best with the crop."""
    scene, near = with_background(drawn, crop), near_pixels(drawn, crop.scale.finer)
    agreements = []
    for blur_px in _BLURS_PX:
        blurred = crop.coded(smooth(scene, blur_px * crop.scale.drawn))
        agreements.append(_correlation(crop.seen, binned(blurred, crop.scale.finer), near))
    return _BLURS_PX[int(np.argmax(agreements))]


def blocks(shape: tuple[int, ...], side_px: int) -> IntArray:
    """(h, w) the number of the square block in which each pixel of an image of a shape is."""
    rows, columns = (np.arange(side) // side_px for side in shape)
    return np.asarray(rows[:, None] * (shape[1] // side_px + 1) + columns)


def share_explained(
    left: Float32Array, variance: Float32Array, near: BoolArray, beside: float = 0.0
) -> float:
    """How much is explained, 0 … 1, where this is left of what varies in windows, and of what stands out
    beside them everything."""
    whole = float(np.sum(variance[near])) + beside
    unexplained = float(np.sum(left[near] ** 2)) + beside
    return float(np.sqrt(max(0.0, 1 - unexplained / max(whole, 1e-9))))


def _correlation(seen: Float32Array, modelled: Float32Array, near: BoolArray) -> float:
    a, b = seen[near].astype(np.float64), modelled[near].astype(np.float64)
    if len(a) < 10:
        return 0.0
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt(float(a @ a) * float(b @ b))
    return max(0.0, float(a @ b) / size) if size > 0 else 0.0
