"""How an image of the spacecraft changes when the spacecraft moves."""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._model.camera import Camera, PixelBox

_FAR_M = np.float32(1e9)
_KERNEL = np.ones((3, 3), np.uint8)


def gradient(image: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Derivatives of an image along columns and rows, per pixel (Scharr)."""
    return (
        np.asarray(cv2.Scharr(image, cv2.CV_32F, 1, 0, scale=1 / 32)),
        np.asarray(cv2.Scharr(image, cv2.CV_32F, 0, 1, scale=1 / 32)),
    )


def by_pose(
    gradients: tuple[Float32Array, Float32Array],
    depth_m: Float32Array,
    reach_px: int,
    camera: Camera,
    box: PixelBox,
    t_body_cam_m: FloatArray,
) -> Float32Array:
    """Derivative of the brightness by the pose (h, w, 6): rotation about the body's origin, rad, and
    shift, m, both in camera axes.

    What a pixel shows moves with the point that it shows, as it is; changes of light are not in it. An
    edge belongs to what is nearer, so the depth is the least within a pixel, and that of the nearest
    point of the spacecraft up to ``reach_px`` beside it.
    """
    z_m = cv2.erode(np.where(np.isfinite(depth_m), depth_m, _FAR_M).astype(np.float32), _KERNEL)
    for _ in range(reach_px):
        z_m = np.where(z_m == _FAR_M, cv2.erode(z_m, _KERNEL), z_m)
    is_near = z_m < _FAR_M
    z_m = np.where(is_near, z_m, np.float32(1))
    u = np.arange(box.x0, box.x0 + box.width, dtype=np.float32)
    v = np.arange(box.y0, box.y0 + box.height, dtype=np.float32)[:, None]
    x_m = np.asarray((u - camera.cx_px) / camera.fx_px * z_m, np.float32)
    y_m = np.asarray((v - camera.cy_px) / camera.fy_px * z_m, np.float32)
    by_x = -gradients[0] * np.float32(camera.fx_px) / z_m * is_near
    by_y = -gradients[1] * np.float32(camera.fy_px) / z_m * is_near
    by_z = -(by_x * x_m + by_y * y_m) / z_m
    rx, ry, rz = (a - np.float32(t) for a, t in zip((x_m, y_m, z_m), t_body_cam_m, strict=True))
    turning = (ry * by_z - rz * by_y, rz * by_x - rx * by_z, rx * by_y - ry * by_x)
    return np.stack([*turning, by_x, by_y, by_z], axis=-1)


def normals(depth_m: Float32Array, camera: Camera, box: PixelBox) -> Float32Array:
    """(h, w, 3) unit normals, away from the camera, of the surfaces whose depth is given; 0 off them.

    The reciprocal of the depth of a plane is affine in the image. Of the differences to both sides the
    smaller counts, which does not cross an edge.
    """
    nearness = np.asarray(1 / depth_m, np.float32)
    along, down = (_least_difference(nearness, axis) for axis in (1, 0))
    a, b = along * np.float32(camera.fx_px), down * np.float32(camera.fy_px)
    u = np.arange(box.x0, box.x0 + box.width, dtype=np.float32)
    v = np.arange(box.y0, box.y0 + box.height, dtype=np.float32)[:, None]
    x, y = (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px
    normal = np.stack([a, b, nearness - a * x - b * y], axis=-1)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(np.nan_to_num(normal / np.maximum(length, 1e-12)), np.float32)


def _least_difference(image: Float32Array, axis: int) -> Float32Array:
    """The smaller of the differences to both neighbours along an axis; 0 where there is neither."""
    steps = np.diff(image, axis=axis)
    none = np.full_like(np.take(image, [0], axis=axis), np.nan)
    after = np.concatenate([steps, none], axis=axis)
    before = np.concatenate([none, steps], axis=axis)
    is_after = np.nan_to_num(np.abs(after), nan=np.inf) < np.nan_to_num(np.abs(before), nan=np.inf)
    return np.asarray(np.nan_to_num(np.where(is_after, after, before)), np.float32)
