"""The times at which the rows of an image are exposed: global or rolling shutter, instant or
exposure."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.camera import Camera, PixelBox

STEP_PX = 0.2
"""Maximum motion in the image from one moment to the next, for images."""
LABEL_STEP_PX = 0.01
"""Maximum motion in the image from one moment to the next, for labels."""
_GRID = 7
"""Number of positions along a box's width and height where motion is computed."""


@dataclass(frozen=True)
class Moment:
    """Rows that are treated as exposed at the same instant.

    Attributes:
        first_row, rows: the first row and the number of rows.
        after_s: the instant, relative to the frame's instant, which is the middle of the middle row's
            exposure.
        share: share of the rows' exposure that the moment stands for.
    """

    first_row: int
    rows: int
    after_s: float
    share: float


def moments(
    camera: Camera, speed_px_s: float, step_px: float, exposure_s: float = 0.0, instants: int = 1
) -> list[Moment]:
    """Divide the exposure of an image into moments in which nothing moves by more than ``step_px``.

    Args:
        camera: gives the rows and the line time.
        speed_px_s: largest speed in the image.
        step_px: largest motion within a moment.
        exposure_s: exposure time of a row.
        instants: maximum number of instants per exposure; 1 means no motion blur. If more would be
            needed, motion within a moment exceeds ``step_px``.

    Returns:
        The moments by rows from the top; the shares of each row add up to 1.
    """
    height, line_s = camera.height_px, camera.line_time_s
    bands = _count(speed_px_s * line_s * height / step_px, height)
    edges = np.rint(np.linspace(0, height, bands + 1)).astype(int).tolist()
    offsets_s = instants_s(speed_px_s, step_px, exposure_s, instants).tolist()
    return [
        Moment(
            first_row=first,
            rows=end - first,
            after_s=float(camera.row_after_s(np.array((first + end - 1) / 2))) + offset_s,
            share=1 / len(offsets_s),
        )
        for first, end in pairwise(edges)
        for offset_s in offsets_s
    ]


def instants_s(speed_px_s: float, step_px: float, exposure_s: float, instants: int) -> FloatArray:
    """(n,) instants in s relative to the middle of the exposure: the middles of n ≤ ``instants`` equal
    parts of it."""
    count = _count(speed_px_s * exposure_s / step_px, instants)
    return exposure_s * ((np.arange(count) + 0.5) / count - 0.5)


def fastest_px_s(
    camera: Camera,
    box: PixelBox,
    v_m_s: FloatArray,
    omega_rad_s: FloatArray,
    near_m: float,
    far_m: float,
) -> float:
    """Largest speed in the image, pixels per second, of points that move by v + ω × x.

    Args:
        camera: the camera.
        box: the part of the image that the points are in.
        v_m_s, omega_rad_s: (3,) camera axes.
        near_m, far_m: least and greatest planar depth of the points; may be infinite.
    """
    u = np.linspace(box.x0, box.x0 + box.width - 1, _GRID)
    v = np.linspace(box.y0, box.y0 + box.height - 1, _GRID)
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
    # The image velocity is linear in the inverse depth, so its length is largest at one of the two
    # depths.
    rates = [np.cross(omega_rad_s, rays) + v_m_s / depth_m for depth_m in (near_m, far_m)]
    image_rates = [rate[..., :2] - rays[..., :2] * rate[..., 2:] for rate in rates]
    scale_px = np.array([camera.fx_px, camera.fy_px]) * camera.stretch[1]
    return float(max(np.linalg.norm(rate * scale_px, axis=-1).max() for rate in image_rates))


def _count(steps: float, most: int) -> int:
    return int(np.clip(np.ceil(steps), 1, most))
