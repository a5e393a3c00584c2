"""What is wrong with the disparity and the visibility of a pair, found by rays of other code."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._interfaces.sensor import StoredReading
from posse_core._model.camera import Camera
from posse_core._model.labels import NOT_IN_FRAME, OCCLUDED, VISIBLE
from posse_core._sensors.stereo.disparity import OFF_CRAFT, SAME_POINT

SAMPLES = 40
"""Pixels of each eye that are tried on the spacecraft, and again beside it."""
DEPTH_ERROR_M = 1e-3
DEPTH_ERROR_SHARE = 1e-5
"""How far a depth may be from the mesh's: as ``posse validate`` allows in depth images."""
BORDER_PX = 0.01
"""How far beyond the border a position may be that counts as within the other image."""


@dataclass(frozen=True)
class _Eye:
    """The arrays of one eye.

    Attributes:
        name: of the eye.
        x_m: where it is in the axes of the right eye.
        other_x_m: where the other eye is.
        disparity_px, visibility: as in :class:`posse_core._sensors.stereo.disparity.EyeLabels`.
    """

    name: str
    x_m: float
    other_x_m: float
    disparity_px: AnyArray
    visibility: AnyArray


def pair_faults(stored: StoredReading, baseline_m: float) -> Iterator[str]:
    """Yield what is wrong with a reading of the right eye."""
    camera, arrays = stored.camera, stored.reading.arrays
    R = stored.mount.R_camera_from_sensor
    if camera is None or camera.distortion is not None:
        yield "has no pinhole camera"
        return
    if list(stored.mount.position_m) != [baseline_m, 0, 0] or not np.array_equal(R, np.eye(3)):
        yield f"the right eye is not {baseline_m:g} m along the camera's x axis"
        return
    for name, other, x_m in (("right", "left", 0.0), ("left", "right", -baseline_m)):
        keys = f"disparity_{name}_px", f"visibility_in_{other}"
        shape = camera.height_px, camera.width_px
        unfit = [
            key
            for key, kind in zip(keys, ("float32", "int8"), strict=True)
            if key not in arrays or arrays[key].shape != shape or arrays[key].dtype != kind
        ]
        if unfit:
            yield f"{unfit[0]} is not there, or not of the image's size and its type"
            continue
        eye = _Eye(name, x_m, -baseline_m - x_m, *(arrays[key] for key in keys))
        yield from _eye_faults(stored, camera, eye)


def _eye_faults(stored: StoredReading, camera: Camera, eye: _Eye) -> Iterator[str]:
    shown = np.isfinite(eye.disparity_px)
    if not np.array_equal(shown, eye.visibility != OFF_CRAFT):
        yield f"disparity and visibility of the {eye.name} eye do not have the same pixels"
        return
    if not np.isin(eye.visibility, (OFF_CRAFT, NOT_IN_FRAME, OCCLUDED, VISIBLE)).all():
        yield f"the visibility of pixels of the {eye.name} eye is not one of -1, 0, 1, 2"
        return
    rows, columns = _sampled(~shown & _around(shown))
    z_m = _depths_m(stored, camera, rows, columns, eye.x_m)
    if np.isfinite(z_m).any():
        where = _first(rows, columns, np.isfinite(z_m))
        yield f"the {eye.name} eye has no disparity at {where}, where the mesh is"

    rows, columns = _sampled(shown)
    d_px = eye.disparity_px[rows, columns].astype(np.float64)
    said_m = camera.fx_px * abs(eye.other_x_m - eye.x_m) / d_px
    tolerance_m = DEPTH_ERROR_M + DEPTH_ERROR_SHARE * said_m
    off = ~(np.abs(_depths_m(stored, camera, rows, columns, eye.x_m) - said_m) <= tolerance_m)
    if off.any():
        yield (
            f"the disparity of the {eye.name} eye is not that of the mesh at"
            f" {_first(rows, columns, off)}: {d_px[off][0]:.4f} px"
        )
        return
    u_px = columns - np.sign(eye.other_x_m - eye.x_m) * d_px
    there_m = _depths_m(stored, camera, rows, u_px, eye.other_x_m)
    visibility = eye.visibility[rows, columns]
    outside = (u_px < -0.5 + BORDER_PX) | (u_px > camera.width_px - 0.5 - BORDER_PX)
    inside = (u_px > -0.5 - BORDER_PX) & (u_px < camera.width_px - 0.5 + BORDER_PX)
    wrong = np.select(
        [visibility == VISIBLE, visibility == OCCLUDED],
        [
            ~inside | ~(np.abs(there_m - said_m) <= tolerance_m),
            ~inside | ~(there_m < said_m * (1 - SAME_POINT / 2)),
        ],
        default=~outside,
    )
    if wrong.any():
        words = {NOT_IN_FRAME: "outside the image", OCCLUDED: "hidden", VISIBLE: "visible"}
        yield (
            f"the point of the {eye.name} eye's pixel {_first(rows, columns, wrong)} is not"
            f" {words[int(visibility[wrong][0])]} in the other eye"
        )


def _depths_m(
    stored: StoredReading, camera: Camera, rows: IntArray, u_px: AnyArray, eye_x_m: float
) -> FloatArray:
    """(N,) depth of the mesh at image positions of an eye; infinite off it."""
    rays = camera.rays(np.stack([u_px, rows], axis=-1))
    after_s = camera.row_after_s(rows.astype(np.float64))
    distances_m = stored.distances_m(rays, (eye_x_m, 0.0, 0.0), after_s)
    return np.asarray(distances_m / np.linalg.norm(rays, axis=1))


def _around(shown: BoolArray) -> BoolArray:
    """(H, W) whether a pixel is in the box around those that are shown, or at its border."""
    box = np.zeros_like(shown)
    rows, columns = np.nonzero(shown)
    if len(rows):
        box[max(0, rows.min() - 1) : rows.max() + 2, max(0, columns.min() - 1) : columns.max() + 2] = (
            True
        )
    else:
        box[:] = True
    return box


def _sampled(of: BoolArray) -> tuple[IntArray, IntArray]:
    """Rows and columns of at most :data:`SAMPLES` pixels, evenly spread over those that are true."""
    rows, columns = np.nonzero(of)
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).astype(int))
    return rows[chosen], columns[chosen]


def _first(rows: IntArray, columns: IntArray, wrong: BoolArray) -> str:
    """The first of the wrong pixels, as (column, row)."""
    return f"({columns[wrong][0]}, {rows[wrong][0]})"
