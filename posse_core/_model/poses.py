"""Poses of a spacecraft relative to a camera, without time or orbit, as a list of labels contains
them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from posse_core._arrays import FloatArray
from posse_core._frames import matrix_from_quaternion


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

    def with_origin(self, r_body_m: FloatArray) -> Poses:
        """The same poses of body axes whose origin is at ``r_body_m`` (3,) of these."""
        moved_m = self.t_body_cam_m + matrix_from_quaternion(self.q_cam_from_body) @ r_body_m
        return replace(self, t_body_cam_m=moved_m)


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
