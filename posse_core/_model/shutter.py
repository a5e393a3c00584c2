"""When the rows of an image see light: in one instant, over an exposure, one row after the other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.camera import Camera, PixelBox

STEP_PX = 0.2
"""How far anything moves in the image from one moment of a picture to the next, at most."""
LABEL_STEP_PX = 0.01
"""The same for the geometry that labels come from."""
_LATTICE = 7
"""Places along a box's width and height where motion is measured."""


@dataclass(frozen=True)
class Moment:
    """Rows that see light together.

    Attributes:
        first_row, rows: which rows of the image.
        after_s: when, against the frame's instant: the middle of the middle row's exposure.
        share: of the exposure.
    """

    first_row: int
    rows: int
    after_s: float
    share: float


def moments(
    camera: Camera, speed_px_s: float, step_px: float, exposure_s: float = 0.0, instants: int = 1
) -> list[Moment]:
    """Cut an image into moments so short that nothing moves by more than ``step_px`` in one.

    Args:
        speed_px_s: of what moves fastest in the image.
        exposure_s: how long a row is exposed; in one instant, if ``instants`` is 1.
        instants: of an exposure, at most; where more were needed, a moment is longer.

    Returns:
        By rows from the top; the shares of every row add up to 1.
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
    """(n,) middles of the n ≤ ``instants`` even parts of an exposure, against its middle, seconds."""
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
    """Largest speed in the image, pixels a second, of points that move by v + ω × x.

    Args:
        box: where in the image.
        v_m_s, omega_rad_s: (3,) camera axes.
        near_m, far_m: planar depths that bound the points; may be infinite.
    """
    u = np.linspace(box.x0, box.x0 + box.width - 1, _LATTICE)
    v = np.linspace(box.y0, box.y0 + box.height - 1, _LATTICE)
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
    # The image velocity is linear in the inverse depth, so that its length is largest at an end.
    rates = [np.cross(omega_rad_s, rays) + v_m_s / depth_m for depth_m in (near_m, far_m)]
    image_rates = [rate[..., :2] - rays[..., :2] * rate[..., 2:] for rate in rates]
    scale_px = np.array([camera.fx_px, camera.fy_px]) * camera.stretch[1]
    return float(max(np.linalg.norm(rate * scale_px, axis=-1).max() for rate in image_rates))


def _count(steps: float, most: int) -> int:
    return int(np.clip(np.ceil(steps), 1, most))
