"""Points of the spacecraft as the rows of an image see them, each at the row's own time."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.camera import Camera
from posse_core._model.labels import View
from posse_core._model.scene import CraftState

_ITERATIONS = 8
"""Most iterations to find the row that sees a point. The remaining error of each is the distance, in
rows, that the point moves within the previous one's error in time."""
_ROW_ERROR = 1e-9
"""Iterations end when none moves a point's row by more than this."""


def seen_by_rows(
    craft: CraftState, camera: Camera, x_body_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find where points of the spacecraft are when the rows of a camera see them.

    Args:
        craft: the state at the frame's instant.
        camera: the camera.
        x_body_m: (N, 3) body axes.

    Returns:
        (N, 3) camera axes, and (N,) seconds after the frame's instant. Above and below the image, the
        first and the last row's time applies; where no row can see a point, because it is behind the
        camera or beyond the reach of its lens, the frame's instant.
    """
    after_s = np.zeros(len(x_body_m))
    x_cam_m = craft.body_in_camera(x_body_m, after_s)
    for _ in range(_ITERATIONS if camera.line_time_s > 0 else 0):
        before_s = after_s
        after_s = np.nan_to_num(camera.row_after_s(camera.project(x_cam_m)[:, 1]))
        x_cam_m = craft.body_in_camera(x_body_m, after_s)
        if np.abs(after_s - before_s).max(initial=0.0) <= _ROW_ERROR * camera.line_time_s:
            break
    return x_cam_m, after_s


def surface_points(
    craft: CraftState, camera: Camera, view: View
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the points of the spacecraft that the pixels of a view show.

    Args:
        craft: the state at the frame's instant.
        camera: the view's.
        view: of the spacecraft at this state, N of whose pixels show it.

    Returns:
        (N, 2) positions of the pixels, px, in the order of ``view.mask``; (N, 3) the points in camera
        axes at the time of the pixel's row; (N, 3) the same in body axes.
    """
    uv_px = view.box.pixel_centres_px()[view.mask]
    x_cam_m = camera.rays(uv_px) * view.depth_m[view.mask, None].astype(np.float64)
    first_row = view.box.y0
    rows_px = np.arange(first_row, first_row + view.box.height, dtype=np.float64)
    R, t = craft.poses_after(camera.row_after_s(rows_px))
    row = np.nonzero(view.mask)[0]
    from_origin_m = x_cam_m - t[row]
    x_body_m = np.stack(
        [np.sum(R[:, :, k][row] * from_origin_m, axis=-1) for k in range(3)], axis=-1
    )  # R's transpose, elementwise, so that the result does not depend on the BLAS library
    return uv_px, x_cam_m, x_body_m
