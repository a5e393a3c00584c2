"""Poses at which the spacecraft looks as it does in an image, from whichever side and under whatever
light: what is tried where the starts lead nowhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._frames import R_about, R_least, R_with_z, turn_rad, unit
from posse_core._model.camera import PixelBox
from posse_core._refinement.background import continued, near_covered
from posse_core._refinement.compare import SHAPE_NOISE, WINDOW_PX, share_explained
from posse_core._refinement.crop import Crop
from posse_core._refinement.flow import normals
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Studio, scaled
from posse_core._refinement.windows import Windows
from posse_core._spacecraft.proposals import sphere

_SIDES, _TURNS = 300, 24
"""Directions from which the spacecraft is drawn, 12 degrees apart, and turns in the image's plane, 15
degrees apart."""
_DRAWN_PX, _RADII = 64, 10.0
"""Size of the sphere around the spacecraft in these drawings, and how many of its radii it is away at
least."""
_MARGIN_PX = 2
"""Of the drawings, around the spacecraft."""
_LEAST_EXTENT_PX = 0.5
"""Of a plate that is seen edge-on."""
_ASPECT = 0.25
"""By how much the logarithm of each side of a pose's box may differ from the detected one's, once both
are of the same area."""
_COMPARED = 1200
"""So many that are explained best by light that is the same everywhere are compared in windows."""
_APART_RAD = np.radians(20)
"""Poses that are found differ by more."""
_BESIDE = 0.05
"""The background is seen so far beside a detected box, as a share of its sides."""
_FAINT = 1e-3
"""Channels whose sum of squares is below this explain little."""
_AXIS = np.array([0.0, 0.0, 1.0])
_TURN_RAD = 2 * np.pi * np.arange(_TURNS) / _TURNS
_R_TURNS = np.array([R_about(_AXIS, turn)[:2, :2] for turn in _TURN_RAD])
"""(T, 2, 2) the turns in the image's plane."""


class _View(NamedTuple):
    """The spacecraft from one side.

    Attributes:
        R_ray_from_body: attitude in axes whose z is the ray to the spacecraft.
        channels: (h, w, 4) coverage, and normals towards the camera times coverage.
        hull_px, origin_px: (H, 2) vertices of the hull and (2,) the body's origin, in its pixels.
        px_rad: pixels of one radian.
        range_m: planar z of the body's origin.
    """

    R_ray_from_body: FloatArray
    channels: Float32Array
    hull_px: FloatArray
    origin_px: FloatArray
    px_rad: float
    range_m: float


class _Fitted(NamedTuple):
    """A view laid into a box of the image.

    Attributes:
        view: the side.
        turn_rad: by which it is turned in the image's plane, from x to y.
        crop_from_view: (2, 3) map of its pixels to those of the crop.
    """

    view: _View
    turn_rad: float
    crop_from_view: FloatArray

    def channels(self, shape: tuple[int, int]) -> Float32Array:
        """(h, w, 4) as of the view, in the crop. The axes of the normals are the view's: light of any
        direction explains the same in all axes."""
        laid = cv2.warpAffine(self.view.channels, self.crop_from_view, shape[::-1])
        return np.asarray(laid, np.float32)

    def halved(self) -> _Fitted:
        """The same in a crop of half as many pixels to each side."""
        A, b = self.crop_from_view[:, :2], self.crop_from_view[:, 2]
        return self._replace(crop_from_view=np.column_stack([A / 2, b / 2]))

    def placement(self, crop: Crop) -> Placement:
        """The pose at which it looks so."""
        A, b = self.crop_from_view[:, :2], self.crop_from_view[:, 2]
        ray = crop.camera.rays(crop.camera_px(A @ self.view.origin_px + b))
        px_rad = float(np.sqrt(np.linalg.det(A))) * self.view.px_rad
        range_m = self.view.range_m * crop.camera.fx_px / (crop.scale.finer * px_rad)
        turn = R_least(_AXIS, unit(ray)) @ R_about(_AXIS, self.turn_rad)
        return Placement(turn @ self.view.R_ray_from_body, range_m * ray)


class Sides:
    """Looks of the spacecraft from all sides, drawn when they are first needed.

    Attributes:
        hull_m: (H, 3) those of the spacecraft's vertices that are on its convex hull.
    """

    def __init__(self, studio: Studio, radius_m: float) -> None:
        self._studio, self._radius_m = studio, radius_m
        self.hull_m = studio.hull_m

    def resembling(
        self, crop: Crop, box_px: FloatArray, t_body_cam_m: FloatArray, count: int
    ) -> list[Placement]:
        """The poses whose outlines and creases explain most of a crop, each of another attitude than
        those before.

        Args:
            box_px: (4,) in which the spacecraft was detected. Some poses are tried whose own boxes lie
                there.
            t_body_cam_m: (3,) where the body's origin is by the keypoints. Others are tried there, as
                what is detected may be a part.
            count: most poses that are returned.
        """
        middle = crop.own_px((box_px[:2] + box_px[2:] / 2) * crop.scale.drawn - 0.5)
        size = box_px[2:] / crop.scale.binned
        own = _without_background(crop, middle, size)
        if own is None:
            return []
        origin = crop.own_px(crop.camera.project(t_body_cam_m[None])[0])
        fitted = list(self._in_box(middle, size))
        if np.isfinite(origin).all():
            px_rad = crop.camera.fx_px / crop.scale.finer
            fitted += self._at(origin, px_rad / float(t_body_cam_m[2]))
        if not fitted:
            return []
        half = np.asarray(cv2.pyrDown(own), np.float32)
        left = _unexplained(half, (each.halved().channels(half.shape) for each in fitted))
        best = [fitted[k] for k in np.argsort(left)[:_COMPARED]]
        shares = [_share(own, each.channels(own.shape), crop) for each in best]
        found: list[Placement] = []
        for k in np.argsort(shares)[::-1]:
            place = best[k].placement(crop)
            turns = [turn_rad(place.R_cam_from_body, each.R_cam_from_body) for each in found]
            if all(turn > _APART_RAD for turn in turns):
                found.append(place)
            if len(found) == count:
                break
        return found

    @cached_property
    def _views(self) -> Sequence[_View]:
        camera = self._studio.camera
        # The sphere fills half of a narrow image.
        radii = max(_RADII, 4 * camera.fx_px / min(camera.width_px, camera.height_px))
        px_rad = _DRAWN_PX * radii / 2
        scale = px_rad / camera.fx_px
        pinhole = scaled(camera, scale)
        ray = pinhole.rays(np.array([pinhole.width_px - 1, pinhole.height_px - 1]) / 2)
        t_m = radii * self._radius_m * ray
        R_cam_from_ray = R_least(_AXIS, unit(ray))
        views = []
        for R_body_from_ray in R_with_z(sphere(_SIDES)):
            place = Placement(R_cam_from_ray @ R_body_from_ray.T, t_m)
            hull_px = pinhole.project(self.hull_m @ place.R_cam_from_body.T + t_m)
            first = np.floor(hull_px.min(axis=0) - _MARGIN_PX).astype(int)
            size = np.ceil(hull_px.max(axis=0) + _MARGIN_PX).astype(int) - first
            box = PixelBox(*first.tolist(), *size.tolist())
            drawn = self._studio.shape(scale, box, place)
            facing = -normals(drawn.depth_m, pinhole, box) * drawn.coverage[..., None]
            channels = np.dstack([drawn.coverage, facing])
            origin_px = pinhole.project(t_m[None])[0] - first
            views.append(
                _View(
                    R_body_from_ray.T,
                    np.asarray(channels, np.float32),
                    hull_px - first,
                    origin_px,
                    pinhole.fx_px,
                    float(t_m[2]),
                )
            )
        return views

    def _in_box(self, middle: FloatArray, size: FloatArray) -> Iterator[_Fitted]:
        """All views and turns whose boxes, once they have the area of a box, are much like it.

        Args:
            middle, size: (2,) of the box, in the crop's pixels.
        """
        for view in self._views:
            turned_px = view.hull_px @ np.swapaxes(_R_TURNS, 1, 2)
            low, high = turned_px.min(axis=1), turned_px.max(axis=1)
            extent = np.maximum(high - low, _LEAST_EXTENT_PX)
            larger = np.sqrt(np.prod(size) / np.prod(extent, axis=1))
            is_alike = np.abs(np.log(size[0] / (larger * extent[:, 0]))) < _ASPECT
            A = larger[:, None, None] * _R_TURNS
            shift = middle - larger[:, None] * (low + high) / 2
            for k in np.flatnonzero(is_alike):
                yield _Fitted(view, float(_TURN_RAD[k]), np.column_stack([A[k], shift[k]]))

    def _at(self, origin: FloatArray, px_m: float) -> Iterator[_Fitted]:
        """All views and turns with the body's origin at one of the crop's pixels (2,).

        Args:
            px_m: the crop's pixels of a metre there.
        """
        for view in self._views:
            A = px_m * view.range_m / view.px_rad * _R_TURNS
            shift = origin - A @ view.origin_px
            for k in range(_TURNS):
                yield _Fitted(view, float(_TURN_RAD[k]), np.column_stack([A[k], shift[k]]))


def _without_background(crop: Crop, middle: FloatArray, size: FloatArray) -> Float32Array | None:
    """What is seen in a crop beyond what surrounds a box, continued into it; None if nothing surrounds
    it."""
    first = middle - (size - 1) / 2
    low = np.floor(first - _BESIDE * size).astype(int)
    high = np.ceil(first + (1 + _BESIDE) * size).astype(int)
    free = np.ones_like(crop.seen)
    free[max(0, low[1]) : max(0, high[1]), max(0, low[0]) : max(0, high[0])] = 0
    if not free.any():
        return None
    return np.asarray(crop.seen - continued(crop.seen * free, free), np.float32)


def _unexplained(own: Float32Array, drawn: Iterable[Float32Array]) -> FloatArray:
    """(N,) the sums of squares that light leaves of an image (h, w), if it is the same everywhere and
    known to Lambert's law but for what it does not reach.

    Args:
        drawn: N × (h, w, 4) channels of the views.
    """
    y = own.ravel().astype(np.float64)
    squares, products = [], []
    for channels in drawn:
        X = channels.reshape(len(y), -1).astype(np.float64)
        squares.append(X.T @ X)
        products.append(X.T @ y)
    b = np.array(products)
    strength = np.linalg.solve(np.array(squares) + _FAINT * np.eye(b.shape[1]), b[..., None])[..., 0]
    return np.asarray(y @ y - np.sum(strength * (b + _FAINT * strength), axis=1))


def _share(own: Float32Array, channels: Float32Array, crop: Crop) -> float:
    """How much of what varies in windows is explained, 0 … 1."""
    near = near_covered(channels[..., 0])
    windows = Windows(near.astype(np.float32), WINDOW_PX)
    left = windows.explained(own, channels[..., :3], SHAPE_NOISE).residual
    return share_explained(left, windows.variance(own), near, crop.beside(near))
