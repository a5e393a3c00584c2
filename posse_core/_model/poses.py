"""Poses of a spacecraft relative to a camera, without time or orbit, as a list of labels contains
them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from posse_core._arrays import FloatArray


@dataclass(frozen=True)
class Poses:
    """F poses.

    Attributes:
        names: (F,) names of the images.
        q_cam_from_body: (F, 4) unit quaternions, scalar first.
        t_body_cam_m: (F, 3) positions of the body axes' origin, camera axes.
    """

    names: tuple[str, ...]
    q_cam_from_body: FloatArray
    t_body_cam_m: FloatArray


class NamedPose(NamedTuple):
    """The pose of one image, exactly as a list of labels gives it.

    Attributes:
        image: name of the image.
        q_cam_from_body: four numbers, scalar first.
        t_body_cam_m: three numbers, position of the body axes' origin in camera axes.
    """

    image: str
    q_cam_from_body: Sequence[float]
    t_body_cam_m: Sequence[float]
