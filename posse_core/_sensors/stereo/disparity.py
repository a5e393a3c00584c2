"""Disparity of a rectified pair, and which of its pixels the other eye sees, by exact rays.

The left eye is at the origin of its axes and the right eye at (b, 0, 0), with the same axes and the
same pinhole camera. A point (x, y, z) of the left eye's axes is at u = fx x/z + cx in the left image and
at u − fx b/z in the right one, in the same row (Hartley and Zisserman 2004, section 11.12). Both eyes
expose a row at the same instant, so this also holds with a rolling shutter: the pair is rectified at
every instant, and a point that one eye sees in a row is in the other's same row at that instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray
from posse_core._interfaces.look import Look
from posse_core._model.camera import Camera
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE

SAME_POINT = 1e-6
"""How far in front of a point a ray to it may end and still meet it, as a share of the distance."""
OFF_CRAFT = -1
"""Visibility of a pixel that shows no body."""


@dataclass(frozen=True)
class EyeLabels:
    """What is labelled of the pixels of one eye.

    Attributes:
        disparity_px: (H, W) float32 u_left − u_right of the point at the pixel's centre; NaN off all
            bodies.
        visibility: (H, W) int8, of that point in the other eye: :data:`VISIBLE`, :data:`OCCLUDED` by a
            body, :data:`NOT_IN_FRAME` of the other image; :data:`OFF_CRAFT`.
    """

    disparity_px: Float32Array
    visibility: IntArray


def eye_labels(look: Look, camera: Camera, other_x_m: float) -> EyeLabels:
    """Label the pixels of one eye.

    Args:
        look: from the eye, in its axes.
        camera: a pinhole, the same in both eyes.
        other_x_m: x of the other eye in these axes: b for the left eye, −b for the right one.
    """
    shape = camera.height_px, camera.width_px
    disparity_px = np.full(shape, np.nan, dtype=np.float32)
    visibility = np.full(shape, OFF_CRAFT, dtype=np.int8)
    view = look.view(camera)
    rows, columns = np.nonzero(view.hit)
    rows, columns = rows + view.box.y0, columns + view.box.x0

    x_m = _first_points(look, camera, rows, columns)
    met = np.isfinite(x_m[:, 2])  # with a rolling shutter, rays at an outline may miss it
    rows, columns, x_m = rows[met], columns[met], x_m[met]
    shift_px = camera.fx_px * other_x_m / x_m[:, 2]
    disparity_px[rows, columns] = np.abs(shift_px)

    u_px = columns - shift_px
    inside = (u_px >= -0.5) & (u_px < camera.width_px - 0.5)
    hidden = _hidden(look, x_m, np.array([other_x_m, 0.0, 0.0]), _after_s(camera, rows))
    visibility[rows, columns] = np.where(inside, np.where(hidden, OCCLUDED, VISIBLE), NOT_IN_FRAME)
    return EyeLabels(disparity_px, visibility)


def _first_points(look: Look, camera: Camera, rows: IntArray, columns: IntArray) -> FloatArray:
    """(N, 3) the points that pixels show, in the axes at their rows' instants; not finite if none."""
    rays = camera.rays(np.stack([columns, rows], axis=-1))
    hits = look.rays(rays, after_s=_after_s(camera, rows))
    z_m = np.where(hits.hit, hits.distance_m, np.nan) / np.linalg.norm(rays, axis=1)
    return np.asarray(rays * z_m[:, None])


def _hidden(look: Look, x_m: FloatArray, eye_m: FloatArray, after_s: FloatArray) -> BoolArray:
    """(N,) bool, whether a body is between points (N, 3) of bodies' surfaces and an eye (3,)."""
    sight_m = x_m - eye_m
    hits = look.rays(sight_m, origin_m=eye_m, after_s=after_s)
    return np.asarray(hits.distance_m < np.linalg.norm(sight_m, axis=1) * (1 - SAME_POINT))


def _after_s(camera: Camera, rows: IntArray) -> FloatArray:
    """Instants of rows (N,) after the frame's; one for all, which is quicker, with a global shutter."""
    return camera.row_after_s(rows.astype(np.float64)) if camera.line_time_s > 0 else np.zeros(())
