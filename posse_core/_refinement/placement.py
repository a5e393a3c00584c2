"""Where the spacecraft is, and how that changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import matrix_from_rotation_vector
from posse_core._interfaces.detector import PoseEstimate


class Placement(NamedTuple):
    """A pose alone: x_cam = R_cam_from_body x_body + t_body_cam_m."""

    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray

    @classmethod
    def of(cls, pose: PoseEstimate) -> Placement:
        """That of an estimate."""
        return cls(
            np.asarray(pose.R_cam_from_body, np.float64), np.asarray(pose.t_body_cam_m, np.float64)
        )

    def moved(self, step: FloatArray) -> Placement:
        """Turned about the body's origin and shifted: (6,) rotation vector (rad) and shift (m), both in
        camera axes."""
        R = matrix_from_rotation_vector(step[:3]) @ self.R_cam_from_body
        return Placement(R, self.t_body_cam_m + step[3:])

    def turned(self, R_body: FloatArray) -> Placement:
        """Turned first, about the body's origin, by (3, 3) in body axes."""
        return Placement(self.R_cam_from_body @ R_body, self.t_body_cam_m)

    def at_range(self, share: float) -> Placement:
        """At this share of the range, in the same direction."""
        return Placement(self.R_cam_from_body, share * self.t_body_cam_m)
