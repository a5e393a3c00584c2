"""The part of an image that shows the spacecraft, at the scales at which it is compared."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.srgb import linear_from_srgb, srgb_from_linear
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import scaled

_MARGIN_SHARE = 0.15
_MARGIN_PX = 8
"""Pixels of the crop about the spacecraft, and at least this share of its extent."""
_LEAST_PX = 8
_FINEST = 4
_LEAST_DRAWN_PX = 150
"""Extent of the spacecraft from which on a drawing of fewer pixels than the image is fine enough."""
_SATURATED = 0.97
_AROUND, _BEYOND = 0.1, 0.4
"""What surrounds a detected box begins so far beyond it and ends so far, as shares of its sides."""
_SPREADS, _LEAST_SPREAD = 3.0, 4 / 255
"""A pixel stands out if it differs from the mean of what surrounds the box by more than so many of its
standard deviations, each at least so large."""


@dataclass(frozen=True)
class Scale:
    """The size of images in which the spacecraft is compared.

    Attributes:
        binned: pixels of the image along each side of one of the crop.
        finer: pixels that are drawn along each side of one of the crop.
    """

    binned: int
    finer: int

    @property
    def drawn(self) -> float:
        """Pixels that are drawn along one of the image."""
        return self.finer / self.binned


@dataclass(frozen=True)
class Crop:
    """A part of the image as a pinhole would see it.

    Attributes:
        scale: of its pixels.
        seen: (h, w) the image's values, 0 … 1.
        linear: (h, w) the brightness that they stand for, 0 … 1.
        is_saturated: (h, w) whether a pixel of the image is white there, or nearly: it may be of any
            brightness.
        is_linear: whether both are the same; otherwise sRGB codes the brightness.
        standing_out: (h, w) square of the difference between what is seen and what surrounds the
            detected box, where it is in the box and stands out; else 0.
        standing_out_beyond: the sum of the same over what of the box is not in the crop.
        drawn_box: the box to draw, in pixels of ``camera``.
        camera: the pinhole that draws it.
    """

    scale: Scale
    seen: Float32Array
    linear: Float32Array
    is_saturated: BoolArray
    is_linear: bool
    standing_out: Float32Array
    standing_out_beyond: float
    drawn_box: PixelBox
    camera: Camera

    def beside(self, near: BoolArray) -> float:
        """The sum of squares of what stands out in the detected box off pixels (h, w) on the spacecraft
        or a little beside it."""
        return self.standing_out_beyond + float(self.standing_out[~near].sum())

    def own_px(self, camera_px: FloatArray) -> FloatArray:
        """(…, 2) pixels of the crop at positions (…, 2) in pixels of ``camera``."""
        return (camera_px - self._corner_px + 0.5) / self.scale.finer - 0.5

    def camera_px(self, own_px: FloatArray) -> FloatArray:
        """(…, 2) pixels of ``camera`` at positions (…, 2) in the crop's."""
        return (own_px + 0.5) * self.scale.finer - 0.5 + self._corner_px

    @property
    def _corner_px(self) -> FloatArray:
        return np.array([self.drawn_box.x0, self.drawn_box.y0], np.float64)

    def coded(self, linear: Float32Array) -> Float32Array:
        """Values of an image of this brightness; what is brighter than white is white."""
        shares = np.clip(linear, 0, 1)
        return np.asarray(shares if self.is_linear else srgb_from_linear(shares), np.float32)


class Picture:
    """An image and its camera, out of which crops are cut.

    Args:
        grey: (H, W) the image's values, 0 … 1.
        camera: that took it.
        is_linear: whether its values are linear in brightness, or else coded by sRGB.
        box_px: (4,) in which the spacecraft was detected; None where that is not known.
    """

    def __init__(
        self, grey: Float32Array, camera: Camera, box_px: FloatArray | None, *, is_linear: bool
    ) -> None:
        self._grey, self._camera, self._is_linear = grey, camera, is_linear
        self._pinhole = scaled(camera, 1)
        self._standing_out = np.zeros_like(grey) if box_px is None else _standing_out(grey, box_px)
        self._all_standing_out = float(self._standing_out.sum())

    def extent_px(self, placement: Placement, vertices_body_m: FloatArray) -> float:
        """The longer side of the box around the spacecraft, px; 0 if it cannot be projected."""
        low, high = self._bounds(placement, vertices_body_m)
        return float((high - low).max())

    def box_px(self, placement: Placement, vertices_body_m: FloatArray) -> FloatArray:
        """The box (4,) around the spacecraft."""
        low, high = self._bounds(placement, vertices_body_m)
        return np.concatenate([low, high - low])

    def share_of(self, placement: Placement, vertices_body_m: FloatArray, box_px: FloatArray) -> float:
        """The length of the box around the spacecraft, as far as it is in the image, over that of a box
        (4,): the square root of the ratio of their areas; 0 if it is not in the image."""
        low, high = self._bounds(placement, vertices_body_m)
        size = np.array([self._camera.width_px, self._camera.height_px]) - 0.5
        width, height = np.clip(high, -0.5, size) - np.clip(low, -0.5, size)
        return float(np.sqrt(width * height / (box_px[2] * box_px[3])))

    def crop(self, placement: Placement, vertices_body_m: FloatArray, scale: Scale) -> Crop | None:
        """The part around the spacecraft at a pose; None if too little of it is in the image."""
        return self.around(*self._bounds(placement, vertices_body_m), scale)

    def around(self, low: FloatArray, high: FloatArray, scale: Scale) -> Crop | None:
        """The part around a box from one corner (2,) to the other, px; None if too little of it is in
        the image."""
        bins, camera = scale.binned, self._camera
        margin_px = max(_MARGIN_PX * bins, _MARGIN_SHARE * float((high - low).max()))
        size = np.array([camera.width_px, camera.height_px]) // bins
        first = np.clip(np.floor((low - margin_px) / bins), 0, size).astype(int)
        last = np.clip(np.ceil((high + margin_px) / bins), 0, size).astype(int)
        width, height = (last - first).tolist()
        if min(width, height) < _LEAST_PX:
            return None
        x0, y0 = first.tolist()
        pixels_box = PixelBox(x0 * bins, y0 * bins, width * bins, height * bins)
        pixels = self._straight(pixels_box)
        linear = binned(pixels, bins)
        is_saturated = binned(pixels > _SATURATED, bins) > 0
        standing_out = binned(self._standing_out[pixels_box.slices], bins)
        beyond = self._all_standing_out / bins**2 - float(standing_out.sum())
        drawn = PixelBox(*(scale.finer * v for v in (x0, y0, width, height)))
        seen = linear if self._is_linear else srgb_from_linear(linear)
        camera = scaled(camera, scale.drawn)
        return Crop(
            scale=scale,
            seen=seen,
            linear=linear,
            is_saturated=is_saturated,
            is_linear=self._is_linear,
            standing_out=standing_out,
            standing_out_beyond=max(0.0, beyond),
            drawn_box=drawn,
            camera=camera,
        )

    def _bounds(
        self, placement: Placement, vertices_body_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        R, t = placement
        px = self._pinhole.project(vertices_body_m @ R.T + t)
        px = px[np.isfinite(px).all(axis=1)]
        if not len(px):
            return np.zeros(2), np.zeros(2)
        return px.min(axis=0), px.max(axis=0)

    def _straight(self, box: PixelBox) -> Float32Array:
        """The linear image in a box of the pinhole's."""
        if self._camera.distortion is None:
            grey: AnyArray = self._grey[box.slices]
        else:
            rays = self._pinhole.rays(box.pixel_centres_px())
            u, v = np.moveaxis(self._camera.project(rays).astype(np.float32), -1, 0)
            grey = cv2.remap(self._grey, u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        share = np.clip(grey, 0, 1, dtype=np.float64)
        return np.asarray(share if self._is_linear else linear_from_srgb(share), np.float32)


def _standing_out(grey: Float32Array, box_px: FloatArray) -> Float32Array:
    """(H, W) square of the difference between an image (H, W) and the mean of what surrounds a box (4,),
    where it is in the box and stands out; else 0."""
    box, around, beyond = (
        _slices(box_px, share, grey.shape) for share in (0.0, _AROUND, _AROUND + _BEYOND)
    )
    is_around = np.zeros(grey.shape, np.bool_)
    is_around[beyond] = True
    is_around[around] = False
    squares = np.zeros_like(grey)
    if is_around.any():
        spread = max(_LEAST_SPREAD, float(grey[is_around].std()))
        off = grey[box] - grey[is_around].mean()
        squares[box] = np.where(np.abs(off) > _SPREADS * spread, off * off, 0)
    return squares


def _slices(box_px: FloatArray, beyond: float, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of an image in a box (4,), extended on each side by a share of its size."""
    x, y, width, height = box_px

    def along(first: float, size: float, last: int) -> slice:
        ends = np.rint([first - beyond * size, first + (1 + beyond) * size])
        return slice(*np.clip(ends, 0, last).astype(int).tolist())

    return along(y, height, shape[0]), along(x, width, shape[1])


def scales(extent_px: float, sizes_px: tuple[float, ...]) -> list[Scale]:
    """The scales at which a spacecraft of an extent has about the sizes, the coarsest first."""
    found: list[Scale] = []
    for size_px in sizes_px:
        bins, finer = 1, 1
        while extent_px / bins > 1.41 * size_px:
            bins *= 2
        # What is thinner than a pixel that is drawn would be seen here and there.
        while finer < min(bins, _FINEST) and finer * size_px < _LEAST_DRAWN_PX:
            finer *= 2
        while bins == 1 and finer < _FINEST and extent_px * finer < 0.67 * size_px:
            finer *= 2
        if Scale(bins, finer) not in found:
            found.append(Scale(bins, finer))
    return found


def binned(pixels: AnyArray, bins: int) -> Float32Array:
    """The means of squares of pixels: (h, w, …) → (h / bins, w / bins, …)."""
    if bins == 1:
        return np.asarray(pixels, np.float32)
    height, width = pixels.shape[:2]
    size = width // bins, height // bins
    means = cv2.resize(np.asarray(pixels, np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(means, np.float32)
