"""The cameras of a dataset: the chaser's, and those of the sensors beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._model.camera import Camera
from posse_core._model.mount import Mount

CHASER = "camera"
"""Name of the chaser's camera."""


@dataclass(frozen=True)
class MountedCamera:
    """A camera of a dataset.

    Attributes:
        topic: path that names it: ``camera``, or ``sensors/NAME`` for a sensor's.
        camera: its intrinsics.
        mount: where it is relative to the chaser's camera.
    """

    topic: str
    camera: Camera
    mount: Mount

    @property
    def T_own_from_chaser(self) -> FloatArray:
        """(4, 4) homogeneous transformation of points from the chaser's camera axes to its own, m."""
        T = np.eye(4)
        T[:3, :3] = self.mount.R_camera_from_sensor.T
        T[:3, 3] = -T[:3, :3] @ self.mount.position_m
        return T


def cameras_of(dataset: Dataset) -> list[MountedCamera]:
    """The chaser's camera, and then those of the sensors that have one, by name."""
    beside = [
        MountedCamera(f"sensors/{name}", info.camera, info.mount)
        for name, info in dataset.sensors.items()
        if info.camera is not None
    ]
    return [MountedCamera(CHASER, dataset.camera, Mount()), *beside]
