"""What the chaser expects of a frame before it looks at it, and poses that are refined from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray
from posse_core._detection.evaluate import LEAST_FLUX_W_M2
from posse_core._detection.shapes import Shapes
from posse_core._frames import R_eci_from_rtn, matrix_from_quaternion, unit
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.navigator import Estimate
from posse_core._model.camera import Camera
from posse_core._model.trajectory import Trajectory
from posse_core._simulator.frame import Frame

_NO_POINTS: BoolArray = np.zeros(0, dtype=bool)


@dataclass(frozen=True)
class Expected:
    """What the chaser expects of a frame; what it does not know is None.

    Attributes:
        pose: of the target.
        sun_direction_cam: (3,) unit vector from the target to the Sun, camera axes; None where that is
            not what lights the target: in eclipse, and between the lamps of a laboratory.
        frame: as the chaser's own renderer makes it.
    """

    pose: PoseEstimate | None = None
    sun_direction_cam: FloatArray | None = None
    frame: Frame | None = None


NOTHING = Expected()


def expected(
    estimate: Estimate | None,
    row: Trajectory,
    q_eci_from_camera: FloatArray,
    frame: Frame | None = None,
) -> Expected:
    """What follows from an estimate at a frame's instant.

    Args:
        estimate: of the motion; None where nothing is known.
        row: one row, of which the orbit of the target and the Sun are known.
        q_eci_from_camera: (4,) the camera's attitude as the chaser knows it.
        frame: as the chaser's own renderer makes it.
    """
    R_cam_from_eci = matrix_from_quaternion(q_eci_from_camera).T
    to_sun_m = row.r_sun_eci_m[0] - row.r_target_eci_m[0]
    is_sunlit = row.sun_fraction_target[0] > 0 and row.solar_flux_w_m2[0] >= LEAST_FLUX_W_M2
    return Expected(
        None if estimate is None else _pose(estimate, row, R_cam_from_eci),
        R_cam_from_eci @ unit(to_sun_m) if is_sunlit else None,
        frame,
    )


def _pose(estimate: Estimate, row: Trajectory, R_cam_from_eci: FloatArray) -> PoseEstimate | None:
    """The pose of an estimate, whose covariance leaves out the error of the camera's attitude."""
    if estimate.q_eci_from_body is None:
        return None
    R_cam_from_body = R_cam_from_eci @ matrix_from_quaternion(estimate.q_eci_from_body)
    R_eci = R_eci_from_rtn(row.r_target_eci_m[0], row.v_target_eci_m_s[0])
    R_cam_from_rtn = R_cam_from_eci @ R_eci
    # Of the estimate's errors, attitude (body axes) and position (of the chaser about the target).
    turned = np.zeros((6, 12))
    turned[:3, 6:9], turned[3:, :3] = R_cam_from_body, -R_cam_from_rtn
    covariance = turned @ estimate.covariance @ turned.T
    t_body_cam_m = -R_cam_from_rtn @ estimate.r_rtn_m
    return PoseEstimate(R_cam_from_body, t_body_cam_m, covariance, _NO_POINTS, 0.0)


class PoseRefiner:
    """Refines the pose of one spacecraft in frame after frame."""

    def __init__(self, shapes: Shapes, label: str, camera: Camera, least_trust: float) -> None:
        """least_trust: of a refined pose."""
        self._shapes, self._label, self._camera = shapes, label, camera
        self._least_trust = least_trust

    def pose(
        self, image: AnyArray, found: Sequence[PoseEstimate], expected: Expected
    ) -> PoseEstimate | None:
        """The pose that the image shows, from those that were found in it and from the expected one.

        A start that the refiner cannot improve says nothing new, so it is not returned.

        Args:
            image: (H, W) or (H, W, 3), as of :meth:`posse_core.Refiner.refine`.
            found: likeliest first.
        """
        starts = [*found] if expected.pose is None else [expected.pose, *found]
        if not starts:
            return None
        made = self._shapes.refined(image, self._label, starts, self._camera, expected.sun_direction_cam)
        if made is None or not made.is_better or made.pose.trust < self._least_trust:
            return None
        return made.pose

    def close(self) -> None:
        """Close the refiner."""
        self._shapes.close()
