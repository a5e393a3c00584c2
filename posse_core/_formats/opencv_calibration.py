"""OpenCV: the cameras of a dataset as ``cv2.FileStorage`` reads them, with the names that OpenCV's own
calibration programs use.

The centre of the first pixel is (0, 0) in OpenCV, as in POSSE. A pair is the chaser's camera (1) and a
sensor's (2): ``x2 = R x1 + T``, as ``cv2.stereoCalibrate`` has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._files.atomic import write_bytes
from posse_core._formats.cameras import MountedCamera, cameras_of
from posse_core._interfaces.writer import Writer
from posse_core._model.camera import Camera


class OpencvCalibrationWriter(Writer):
    """Writes a folder ``opencv-calibration``: ``camera.yaml`` and ``sensors/NAME.yaml``."""

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``opencv-calibration``."""
        home = folder / "opencv-calibration"
        chaser, *beside = cameras_of(dataset)
        _write(home / f"{chaser.topic}.yaml", chaser.camera, {})
        for sensor in beside:
            _write(home / f"{sensor.topic}.yaml", sensor.camera, _pair(chaser.camera, sensor))
        return [home]


def _write(path: Path, camera: Camera, pair: Mapping[str, FloatArray]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_matrix", camera.matrix)
    storage.write("fisheye_model", int(_is_fisheye(camera)))
    storage.write("distortion_coefficients", camera.distortion_coefficients[:, None])
    for key, matrix in pair.items():
        storage.write(key, matrix)
    write_bytes(path, storage.releaseAndGetString().encode())


def _is_fisheye(camera: Camera) -> bool:
    return camera.distortion is not None and camera.distortion.model == "fisheye"


def _pair(left: Camera, right: MountedCamera) -> dict[str, FloatArray]:
    """``R`` and ``T``, and the rectification where there is one: for images of one size from two
    places, through lenses of one kind."""
    T_right_from_left = right.T_own_from_chaser
    R, T = T_right_from_left[:3, :3].copy(), T_right_from_left[:3, 3:].copy()
    same_size = (left.width_px, left.height_px) == (right.camera.width_px, right.camera.height_px)
    same_kind = _is_fisheye(left) == _is_fisheye(right.camera)
    if not same_size or not same_kind or not T.any():
        return {"R": R, "T": T}
    return {"R": R, "T": T, **_rectification(left, right.camera, R, T)}


def _rectification(left: Camera, right: Camera, R: FloatArray, T: FloatArray) -> dict[str, FloatArray]:
    """``R1``, ``R2``, ``P1``, ``P2`` and ``Q`` of ``cv2.stereoRectify`` with zero disparity at infinity.

    A pair that is rectified already stays as it is. OpenCV would scale its images where fx ≠ fy.
    """
    if left == right and left.distortion is None and np.array_equal(R, np.eye(3)) and not T[1:].any():
        K, f_px, aspect = left.matrix, left.fx_px, left.fx_px / left.fy_px
        Q = np.zeros((4, 4))
        Q[0, [0, 3]] = 1, -left.cx_px
        Q[1, [1, 3]] = aspect, -aspect * left.cy_px
        Q[2, 3], Q[3, 2] = f_px, -1 / T[0, 0]
        names = {"R1": R, "R2": R, "P1": np.hstack([K, np.zeros((3, 1))]), "P2": np.hstack([K, K @ T])}
        return {**names, "Q": Q}
    lenses = left.matrix, left.distortion_coefficients, right.matrix, right.distortion_coefficients
    size = left.width_px, left.height_px
    flags = cv2.CALIB_ZERO_DISPARITY
    found: Sequence[object] = (
        cv2.fisheye.stereoRectify(*lenses, size, R, T, flags)
        if _is_fisheye(left)
        else cv2.stereoRectify(*lenses, size, R, T, flags=flags, alpha=-1)
    )
    return dict(zip(("R1", "R2", "P1", "P2", "Q"), map(np.asarray, found[:5]), strict=True))
