"""Poses of a spacecraft in a camera, without time or orbit: what a list of labels holds."""

from __future__ import annotations

from dataclasses import dataclass

from posse_core._arrays import FloatArray


@dataclass(frozen=True)
class Poses:
    """F poses.

    Attributes:
        names: (F,) of the images.
        q_cam_from_body: (F, 4) unit, scalar first.
        t_body_cam_m: (F, 3) position of the body's origin in camera axes.
    """

    names: tuple[str, ...]
    q_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
