"""Comparison of a crop with what would be seen at a pose."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import BoolArray, Float32Array
from posse_core._refinement.crop import Crop, binned
from posse_core._refinement.flow import by_pose, gradient
from posse_core._refinement.light import Light
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Drawn, Studio
from posse_core._refinement.windows import Windows, smooth

_WINDOW_PX = 6.0
"""Standard deviation of the windows in which gains are fitted."""
_BESIDE_PX = 2
"""How far beside the spacecraft pixels are compared."""
_NOISE = 4 / 255
"""Variations of what is drawn below this share of white say nothing."""
_KERNEL = np.ones((3, 3), np.uint8)


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


class LitComparer:
    """Compares brightness, with light of a known direction."""

    def __init__(self, crop: Crop, studio: Studio, light: Light) -> None:
        self._crop, self._studio, self._light = crop, studio, light

    def compare(self, placement: Placement) -> Comparison:
        """Draw the spacecraft and compare."""
        crop, light = self._crop, self._light
        drawn = self._studio.draw(crop.scale.drawn, crop.drawn_box, placement, light.lights)
        return self.compared(drawn, placement)

    def agreement(self, drawn: Drawn) -> float:
        """How well the crop agrees with what is drawn already."""
        finer = self._crop.scale.finer
        return _correlation(self._crop.seen, binned(self._scene(drawn), finer), _near(drawn, finer))

    def _scene(self, drawn: Drawn) -> Float32Array:
        """What is drawn before its background, as sharp and as coded as the crop."""
        blur_px = self._light.blur_px * self._crop.scale.drawn
        return self._crop.coded(smooth(with_background(drawn, self._crop), blur_px))

    def compared(self, drawn: Drawn, placement: Placement) -> Comparison:
        """The same for what is drawn already."""
        crop, finer = self._crop, self._crop.scale.finer
        blur_px, scene = self._light.blur_px * crop.scale.drawn, self._scene(drawn)
        seen, modelled = crop.seen, binned(scene, finer)
        near = _near(drawn, finer)
        windows = Windows(near.astype(np.float32), _WINDOW_PX)
        explained = windows.explained(seen, modelled[..., None], _NOISE, (0.0, 3.0))
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
        return Comparison(explained.residual, jacobian, near, _correlation(seen, modelled, near))


def with_background(drawn: Drawn, crop: Crop) -> Float32Array:
    """What is drawn, before what is seen beside the spacecraft, as smooth as it must be to reach behind
    it."""
    finer = crop.scale.finer
    covered = cv2.dilate(binned(drawn.coverage, finer), np.ones((7, 7), np.uint8))
    free = (covered < 1e-3).astype(np.float32)
    if not free.any():
        return drawn.bright
    sigma_px = max(4.0, 0.12 * max(free.shape))
    light = crop.linear * free
    sums, weights = np.full_like(free, 1e-6 * light.sum() / free.sum()), np.full_like(free, 1e-6)
    for each_px, share in ((sigma_px, 1.0), (4 * sigma_px, 1e-2)):
        sums += np.float32(share) * smooth(light, each_px)
        weights += np.float32(share) * smooth(free, each_px)
    behind = cv2.resize(sums / weights, drawn.bright.shape[::-1])
    return np.asarray(drawn.bright + (1 - drawn.coverage) * behind, np.float32)


def _near(drawn: Drawn, finer: int) -> BoolArray:
    """Pixels on the spacecraft and a little beside it."""
    on = (binned(drawn.coverage, finer) > 0).astype(np.uint8)
    return np.asarray(cv2.dilate(on, _KERNEL, iterations=_BESIDE_PX) > 0)


def _correlation(seen: Float32Array, modelled: Float32Array, near: BoolArray) -> float:
    a, b = seen[near].astype(np.float64), modelled[near].astype(np.float64)
    if len(a) < 10:
        return 0.0
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt(float(a @ a) * float(b @ b))
    return max(0.0, float(a @ b) / size) if size > 0 else 0.0
