"""The spacecraft drawn from all sides, and its drawings laid into an image."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._frames import R_about, R_least, R_with_z, unit
from posse_core._model.camera import PixelBox
from posse_core._refinement.crop import Crop
from posse_core._refinement.edges import edges, turned_edges
from posse_core._refinement.flow import normals
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Studio, scaled
from posse_core._spacecraft.proposals import sphere

_SIDES, _TURNS = 300, 24
"""Directions from which the spacecraft is drawn, 12 degrees apart, and turns in the image's plane, 15
degrees apart."""
_DRAWN_PX, _RADII = 64, 10.0
"""Size of the sphere around the spacecraft in these drawings, and how many of its radii it is away at
least."""
_MARGIN_PX = 6
"""Of the drawings, around the spacecraft."""
_LEAST_EXTENT_PX = 0.5
"""Of a plate that is seen edge-on."""
_EDGE_BLUR_PX = 2.7
"""Of the drawings' edges: as :data:`posse_core._refinement.edges.EDGE_BLUR_PX` where the spacecraft has
48 pixels."""
_AXIS = np.array([0.0, 0.0, 1.0])
_TURN_RAD = 2 * np.pi * np.arange(_TURNS) / _TURNS
_R_TURNS = np.array([R_about(_AXIS, turn)[:2, :2] for turn in _TURN_RAD])
"""(T, 2, 2) the turns in the image's plane."""


class View(NamedTuple):
    """The spacecraft from one side.

    Attributes:
        R_ray_from_body: attitude in axes whose z is the ray to the spacecraft.
        channels: (h, w, 4) coverage, and normals towards the camera times coverage.
        edges: (h, w, 3) of the channels; see :func:`posse_core._refinement.edges.edges`.
        hull_px, origin_px: (H, 2) vertices of the hull and (2,) the body's origin, in its pixels.
        px_rad: pixels of one radian.
        range_m: planar z of the body's origin.
    """

    R_ray_from_body: FloatArray
    channels: Float32Array
    edges: Float32Array
    hull_px: FloatArray
    origin_px: FloatArray
    px_rad: float
    range_m: float


class Laid(NamedTuple):
    """A view laid into a crop.

    Attributes:
        view: the side.
        turn_rad: by which it is turned in the image's plane, from x to y.
        crop_from_view: (2, 3) map of its pixels to those of the crop.
        box_px: (4,) the spacecraft's box in the crop.
    """

    view: View
    turn_rad: float
    crop_from_view: FloatArray
    box_px: FloatArray

    def channels(self, shape: tuple[int, int]) -> Float32Array:
        """(h, w, 4) as of the view, in the crop. The axes of the normals are the view's: light of any
        direction explains the same in all axes."""
        laid = cv2.warpAffine(self.view.channels, self.crop_from_view, shape[::-1])
        return np.asarray(laid, np.float32)

    def edges(self, shape: tuple[int, int]) -> Float32Array:
        """(h, w, 3) as of the view, in the crop."""
        laid = cv2.warpAffine(self.view.edges, self.crop_from_view, shape[::-1])
        return turned_edges(np.asarray(laid, np.float32), self.turn_rad)

    def halved(self) -> Laid:
        """The same in a crop of half as many pixels to each side."""
        return self._replace(crop_from_view=self.crop_from_view / 2, box_px=self.box_px / 2)

    def shifted(self, by: FloatArray) -> Laid:
        """The same, so many of the crop's pixels (2,) further."""
        A, b = self.crop_from_view[:, :2], self.crop_from_view[:, 2]
        box_px = np.concatenate([self.box_px[:2] + by, self.box_px[2:]])
        return self._replace(crop_from_view=np.column_stack([A, b + by]), box_px=box_px)

    def placement(self, crop: Crop) -> Placement:
        """The pose at which it looks so."""
        A, b = self.crop_from_view[:, :2], self.crop_from_view[:, 2]
        ray = crop.camera.rays(crop.camera_px(A @ self.view.origin_px + b))
        px_rad = float(np.sqrt(np.linalg.det(A))) * self.view.px_rad
        range_m = self.view.range_m * crop.camera.fx_px / (crop.scale.finer * px_rad)
        turn = R_least(_AXIS, unit(ray)) @ R_about(_AXIS, self.turn_rad)
        return Placement(turn @ self.view.R_ray_from_body, range_m * ray)


class Views:
    """Drawings of the spacecraft from all sides, made when they are first needed.

    Args:
        radius_m: of the sphere around the spacecraft.
    """

    def __init__(self, studio: Studio, radius_m: float) -> None:
        self._studio, self._radius_m = studio, radius_m
        self._drawn: list[View] = []

    def of_area(self, area: float, middle: FloatArray) -> Iterator[Laid]:
        """All views in all turns, so large that their boxes have an area, about a point (2,) of a
        crop."""
        for view in self._all():
            low, extent = _boxes(view)
            larger = np.sqrt(area / np.prod(extent, axis=1))
            shift = middle - larger[:, None] * (low + extent / 2)
            yield from _laid(view, larger, shift, low, extent)

    def at(self, origin: FloatArray, px_m: float) -> Iterator[Laid]:
        """All views and turns with the body's origin at one of a crop's pixels (2,).

        Args:
            px_m: the crop's pixels of a metre there.
        """
        for view in self._all():
            larger = px_m * view.range_m / view.px_rad
            shift = origin - larger * _R_TURNS @ view.origin_px
            yield from _laid(view, np.full(_TURNS, larger), shift, *_boxes(view))

    def _all(self) -> Iterator[View]:
        for k, R_body_from_ray in enumerate(R_with_z(sphere(_SIDES))):
            if k == len(self._drawn):
                self._drawn.append(self._view(R_body_from_ray))
            yield self._drawn[k]

    def _view(self, R_body_from_ray: FloatArray) -> View:
        camera = self._studio.camera
        # The sphere fills half of a narrow image.
        radii = max(_RADII, 4 * camera.fx_px / min(camera.width_px, camera.height_px))
        px_rad = _DRAWN_PX * radii / 2
        scale = px_rad / camera.fx_px
        pinhole = scaled(camera, scale)
        ray = pinhole.rays(np.array([pinhole.width_px - 1, pinhole.height_px - 1]) / 2)
        t_m = radii * self._radius_m * ray
        place = Placement(R_least(_AXIS, unit(ray)) @ R_body_from_ray.T, t_m)
        hull_px = pinhole.project(self._studio.hull_m @ place.R_cam_from_body.T + t_m)
        first = np.floor(hull_px.min(axis=0) - _MARGIN_PX).astype(int)
        size = np.ceil(hull_px.max(axis=0) + _MARGIN_PX).astype(int) - first
        box = PixelBox(*first.tolist(), *size.tolist())
        drawn = self._studio.shape(scale, box, place)
        facing = -normals(drawn.depth_m, pinhole, box) * drawn.coverage[..., None]
        channels = np.asarray(np.dstack([drawn.coverage, facing]), np.float32)
        return View(
            R_body_from_ray.T,
            channels,
            edges(channels, _EDGE_BLUR_PX),
            hull_px - first,
            pinhole.project(t_m[None])[0] - first,
            pinhole.fx_px,
            float(t_m[2]),
        )


def _boxes(view: View) -> tuple[FloatArray, FloatArray]:
    """(T, 2) the first corners and the sizes of a view's boxes about its pixel 0, turned in each way."""
    turned_px = view.hull_px @ np.swapaxes(_R_TURNS, 1, 2)
    low = turned_px.min(axis=1)
    return low, np.maximum(turned_px.max(axis=1) - low, _LEAST_EXTENT_PX)


def _laid(
    view: View, larger: FloatArray, shift: FloatArray, low: FloatArray, extent: FloatArray
) -> Iterator[Laid]:
    """A view in each turn, so many times as large (T,), its pixel 0 at points (T, 2) of a crop.

    low, extent: of :func:`_boxes`.
    """
    A = larger[:, None, None] * _R_TURNS
    boxes_px = np.concatenate([shift + larger[:, None] * low, larger[:, None] * extent], axis=1)
    for k in range(_TURNS):
        yield Laid(view, float(_TURN_RAD[k]), np.column_stack([A[k], shift[k]]), boxes_px[k])
