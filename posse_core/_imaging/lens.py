"""A distorting lens in front of any renderer.

Renderers are pinhole cameras. For a distorting lens, the renderer makes a pinhole image that contains
the lens's whole field of view, with pixels at most half as wide as those of the distorted image. Each
pixel of the distorted image is the mean of samples of that pinhole image.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._errors import ComponentError
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.scene import Radiance, RenderRequest, Scene

FINER = 2
"""Minimum number of pinhole pixels across one pixel of the distorted image."""
_MAX_SIDE_PX = 32766
"""The largest image that OpenCV's remap can read."""
_PLANE_TOLERANCE_SHARE = 1e-5
"""Tolerance, relative to 1/z, within which the 1/z of four neighbours must lie on one plane."""
_MARGIN_PX = 2
_ROWS = 64
"""Number of rows that are processed at once, to save memory."""


class LensRenderer(Renderer):
    """Applies the scene's lens distortion to a renderer. Without distortion it only passes requests
    on."""

    def __init__(self, renderer: Renderer) -> None:
        super().__init__(renderer.options)
        self._renderer = renderer
        self._camera: Camera | None = None
        self._pinhole: Camera | None = None

    def open(self, scene: Scene) -> None:
        self._camera = scene.camera
        if scene.camera.distortion is not None:
            self._pinhole = pinhole_of(scene.camera)
            widest_px = max(self._pinhole.width_px, self._pinhole.height_px)
            if widest_px > _MAX_SIDE_PX:
                raise ComponentError(
                    f"with this lens the renderer would need an image of {widest_px} px, but at most"
                    f" {_MAX_SIDE_PX} px can be distorted; use an image with fewer pixels"
                )
            scene = replace(scene, camera=self._pinhole)
        self._renderer.open(scene)

    def render(self, request: RenderRequest) -> Radiance:
        if self._camera is None or self._pinhole is None:
            return self._renderer.render(request)
        corners_px = self._pinhole.project(self._camera.rays(_corners_px(request.box)))
        box = _box_around(corners_px, self._pinhole)
        image = self._renderer.render(replace(request, box=box))
        centres_px = self._pinhole.project(self._camera.rays(request.box.pixel_centres_px()))
        return _distorted(image, request.box, corners_px, centres_px, samples(self._camera))

    def close(self) -> None:
        self._renderer.close()

    def describe(self) -> Mapping[str, str]:
        """The description of the renderer."""
        return self._renderer.describe()


def pinhole_of(camera: Camera) -> Camera:
    """The pinhole camera with square pixels that covers the field of view of a distorting camera, at the
    resolution that :data:`FINER` asks for."""
    rays = camera.rays(camera.border_px())
    low, high = rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)
    focal_px = FINER * max(camera.fx_px, camera.fy_px) * camera.stretch[1]
    width_px, height_px = (ceil(focal_px * side) + 2 * _MARGIN_PX for side in high - low)
    return Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=float(_MARGIN_PX - 0.5 - focal_px * low[0]),
        cy_px=float(_MARGIN_PX - 0.5 - focal_px * low[1]),
        sensor_width_m=camera.focal_length_m * width_px / focal_px,
    )


def samples(camera: Camera) -> int:
    """The number of samples per pixel and axis that are taken from the pinhole image, bilinearly.

    Their spacing is about one pinhole pixel or half of one, for which bilinear weights are uniform.
    """
    least, most = camera.stretch
    return FINER * (1 if most < 1.1 * least else 2 if most < 2.2 * least else 4)


def _corners_px(box: PixelBox) -> FloatArray:
    """(h + 1, w + 1, 2) positions of the corners of a box's pixels."""
    return PixelBox(box.x0, box.y0, box.width + 1, box.height + 1).pixel_centres_px() - 0.5


def _box_around(positions_px: FloatArray, camera: Camera) -> PixelBox:
    """The pixels that bilinear interpolation at the positions (..., 2) needs."""
    limit = np.array([camera.width_px, camera.height_px]) - 1
    low = np.clip(np.floor(positions_px.min(axis=(0, 1))), 0, limit).astype(int).tolist()
    high = np.clip(np.ceil(positions_px.max(axis=(0, 1))), 0, limit).astype(int).tolist()
    return PixelBox(low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1)


def _distorted(
    image: Radiance, box: PixelBox, corners_px: FloatArray, centres_px: FloatArray, n: int
) -> Radiance:
    """Distort a pinhole image.

    Args:
        image: the pinhole image, in its own box.
        box: the box of the distorted image, h × w pixels.
        corners_px: (h + 1, w + 1, 2) positions of the corners of these pixels in the pinhole image.
        centres_px: (h, w, 2) positions of their centres in the pinhole image.
        n: number of samples per pixel and axis.
    """
    origin_px = np.array([image.box.x0, image.box.y0])
    source = np.dstack([image.radiance_rgb, image.coverage])
    distorted = np.empty((box.height, box.width, 4), dtype=np.float32)
    for top in range(0, box.height, _ROWS):
        rows = slice(top, min(top + _ROWS, box.height))
        positions = _sampled(corners_px[rows.start : rows.stop + 1] - origin_px, n)
        positions = positions.reshape(-1, box.width, 2)  # what remap makes is limited in size as well
        sampled = cv2.remap(
            source,
            positions[..., 0],
            positions[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        distorted[rows] = sampled.reshape(-1, n, box.width, n, 4).mean(axis=(1, 3))
    depth_m = None if image.depth_m is None else _depth_at(image.depth_m, centres_px - origin_px)
    return Radiance(box, np.ascontiguousarray(distorted[..., :3]), distorted[..., 3].copy(), depth_m)


def _sampled(corners_px: FloatArray, n: int) -> Float32Array:
    """(h + 1, w + 1, 2) corners of pixels → (h n, w n, 2) positions of n² samples in each pixel.

    The positions are linear between the corners; within a pixel, distortion deviates from that by 10⁻⁴
    px.
    """
    steps = (np.arange(n) + 0.5) / n
    for axis in (0, 1):
        c = np.moveaxis(corners_px, axis, 0)
        between = c[:-1, None] + steps[:, None, None] * (c[1:] - c[:-1])[:, None]
        corners_px = np.moveaxis(between.reshape(-1, *c.shape[1:]), 0, axis)
    return np.ascontiguousarray(corners_px, dtype=np.float32)


def _depth_at(depth_m: Float32Array, positions_px: FloatArray) -> Float32Array:
    """(h, w) planar depth at positions (h, w, 2), NaN where the four pixels around one are not of one
    plane. In the image of a plane, 1/z is linear.
    """
    size = np.array(depth_m.shape[::-1])
    first = np.clip(np.floor(positions_px).astype(np.intp), 0, np.maximum(size - 2, 0))
    u, v = np.moveaxis(np.clip(positions_px - first, 0, 1), -1, 0)
    (x, y), (x1, y1) = np.moveaxis(first, -1, 0), np.moveaxis(np.minimum(first + 1, size - 1), -1, 0)
    near = 1 / depth_m.astype(np.float64)
    a, b, c, d = near[y, x], near[y, x1], near[y1, x], near[y1, x1]
    at = (a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v
    return np.where(np.abs(a + d - b - c) < _PLANE_TOLERANCE_SHARE * at, 1 / at, np.nan).astype(
        np.float32
    )
