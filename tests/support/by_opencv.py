"""A camera's projection and its inverse by OpenCV, whatever its lens."""

from __future__ import annotations

import cv2
import numpy as np

from posse_core._model.camera import Camera

_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)


def projected_px(camera: Camera, x_cam_m: np.ndarray) -> np.ndarray:
    """(N, 3) camera axes → (N, 2) pixels."""
    project = cv2.fisheye.projectPoints if _is_fisheye(camera) else cv2.projectPoints
    points, zeros = np.ascontiguousarray(x_cam_m, dtype=float)[:, None], np.zeros(3)
    return project(points, zeros, zeros, camera.matrix, camera.distortion_coefficients)[0][:, 0]


def flat_of(camera: Camera, uv_px: np.ndarray) -> np.ndarray:
    """(..., 2) pixels → (..., 2) x and y of the directions at z = 1, by OpenCV's iteration."""
    undistort = cv2.fisheye.undistortPoints if _is_fisheye(camera) else cv2.undistortPoints
    pixels = np.ascontiguousarray(uv_px, dtype=float).reshape(-1, 1, 2)
    flat = undistort(
        pixels, camera.matrix, camera.distortion_coefficients, R=None, P=None, criteria=_UNTIL
    )
    return np.asarray(flat).reshape(np.shape(uv_px))


def _is_fisheye(camera: Camera) -> bool:
    return len(camera.distortion_coefficients) == 4
