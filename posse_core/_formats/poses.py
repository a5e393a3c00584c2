"""Reading poses from the labels of other datasets: SPEED, SPEED+ and URSO."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_core._dataset.camera import read_camera
from posse_core._errors import InputError
from posse_core._formats.speed import read_speed
from posse_core._formats.urso import is_urso, read_urso
from posse_core._frames import unit
from posse_core._model.camera import Camera
from posse_core._model.poses import Poses

_FARTHEST_M = 1e9
_QUATERNION_LENGTH_ERROR = 1e-3
"""Largest allowed difference of a quaternion's length from 1."""


def read_poses(path: Path) -> Poses:
    """Read the JSON labels of SPEED or SPEED+, or ``PART_poses_gt.csv`` of URSO.

    Raises:
        InputError: The file is missing or of another kind, or an entry is not a pose.
    """
    entries = list(read_urso(path) if is_urso(path) else read_speed(path))
    if not entries:
        raise InputError(f"{path}: has no poses; name another file")
    q = np.array([pose.q_cam_from_body for pose in entries], dtype=np.float64)
    t_m = np.array([pose.t_body_cam_m for pose in entries], dtype=np.float64)
    if not np.all(np.abs(t_m) < _FARTHEST_M):  # false for NaN
        raise InputError(f"{path}: a position is not finite, or is beyond {_FARTHEST_M:g} m")
    bad = ~(np.abs(np.linalg.norm(q, axis=1) - 1) < _QUATERNION_LENGTH_ERROR) | ~(t_m[:, 2] > 0)
    if bad.any():
        raise InputError(
            f"{path}: {entries[int(np.argmax(bad))].image}: the quaternion is not of length 1, or the"
            " target is not in front of the camera"
        )
    return Poses(tuple(pose.image for pose in entries), unit(q), t_m)


def camera_beside(labels: Path) -> Camera | None:
    """Read SPEED+'s ``camera.json`` in the labels' folder or the one above; None if there is none.

    Raises:
        InputError: The file cannot be read.
    """
    for folder in (labels.parent, labels.absolute().parent.parent):
        if (folder / "camera.json").is_file():
            return read_camera(folder / "camera.json")
    return None
