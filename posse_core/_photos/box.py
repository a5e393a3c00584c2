"""The box of a spacecraft in a photograph, by its mesh and pose."""

from __future__ import annotations

import numpy as np

from posse_core._geometry.outline import edges_of, extent_px
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.spacecraft import Spacecraft


def box_px(pose: PoseEstimate, craft: Spacecraft, camera: Camera) -> PixelBox:
    """The whole pixels around the mesh, within the photograph."""
    low, high = [], []
    for part in craft.parts:
        vertices_cam_m = part.vertices_body_m @ pose.R_cam_from_body.T + pose.t_body_cam_m
        corners = extent_px(camera, vertices_cam_m, edges_of(part.faces))
        low.append(corners[0])
        high.append(corners[1])
    most = np.array([camera.width_px, camera.height_px]) - 1
    # What cannot be projected, behind the camera or beyond the reach of its lens, leaves the photograph.
    first = np.nan_to_num(np.min(low, axis=0), nan=0.0)
    last = np.nan_to_num(np.max(high, axis=0), nan=np.inf)
    x, y = (int(value) for value in np.clip(np.floor(first + 0.5), 0, most))
    right, bottom = (int(value) for value in np.clip(np.floor(last + 0.5), 0, most))
    return PixelBox(x, y, right - x + 1, bottom - y + 1)
