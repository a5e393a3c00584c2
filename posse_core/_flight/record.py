"""From the steps of a flight to its record and its trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._flight.watch import Step
from posse_core._frames import R_eci_from_rtn, matrix_from_quaternion, quaternion_from_matrix
from posse_core._interfaces.controller import ControlProblem, Safety
from posse_core._interfaces.navigator import Readings
from posse_core._model.flight_record import FlightRecord
from posse_core._model.trajectory import TRAJECTORY_ARRAYS, Trajectory


def joined(rows: Sequence[Trajectory]) -> Trajectory:
    """The trajectory of several rows."""
    arrays = {name: np.concatenate([getattr(row, name) for row in rows]) for name in TRAJECTORY_ARRAYS}
    extras = {name: np.concatenate([row.extras[name] for row in rows]) for name in rows[0].extras}
    return Trajectory(epoch_utc=rows[0].epoch_utc, **arrays, extras=extras)


def flight_record(
    steps: Sequence[Step], control: ControlProblem | None, least_dv_m_s: float
) -> FlightRecord:
    """The record of a flight that has ended, or of a sequence that was tracked.

    Args:
        steps: all of its steps.
        control: what the flight was to achieve; None where nothing was.
        least_dv_m_s: sum of the impulses of the best plan that knows everything.
    """
    truth = joined([step.row for step in steps])
    nis, dof, rejected = _innovations(steps)
    r_single_rtn_m, q_single = _singles(steps)
    waypoints = () if control is None else control.waypoints
    safety = Safety() if control is None else control.safety
    cone = np.full(5, np.nan)
    if safety.cone is not None:
        cone = np.array([*safety.cone.axis_rtn, safety.cone.half_angle_rad, safety.cone.length_m])
    return FlightRecord(
        t_s=truth.t_s,
        r_true_rtn_m=truth.r_chaser_rtn_m,
        v_true_rtn_m_s=truth.v_chaser_rtn_m_s,
        q_true_eci_from_body=truth.q_eci_from_body,
        omega_true_body_rad_s=truth.omega_body_rad_s,
        r_rtn_m=_of_estimates(steps, "r_rtn_m", (3,)),
        v_rtn_m_s=_of_estimates(steps, "v_rtn_m_s", (3,)),
        q_eci_from_body=_of_estimates(steps, "q_eci_from_body", (4,)),
        omega_body_rad_s=_of_estimates(steps, "omega_body_rad_s", (3,)),
        covariance=_of_estimates(steps, "covariance", (12, 12)),
        r_single_rtn_m=r_single_rtn_m,
        q_single_eci_from_body=q_single,
        burn_s=np.array([step.burn_s for step in steps]),
        dv_commanded_rtn_m_s=np.array([step.dv_commanded_rtn_m_s for step in steps]),
        dv_rtn_m_s=np.array([step.dv_rtn_m_s for step in steps]),
        nis=nis,
        dof=dof,
        rejected=rejected,
        t_waypoint_s=np.array([point.t_s for point in waypoints]),
        until_waypoint_s=np.array([point.until_s for point in waypoints]),
        r_waypoint_rtn_m=np.reshape([point.r_rtn_m for point in waypoints], (-1, 3)),
        v_waypoint_rtn_m_s=np.reshape([point.v_rtn_m_s for point in waypoints], (-1, 3)),
        keep_out_m=np.full(3, np.nan) if safety.keep_out_m is None else safety.keep_out_m,
        cone=cone,
        least_dv_m_s=np.array(least_dv_m_s),
    )


def _of_estimates(steps: Sequence[Step], name: str, shape: tuple[int, ...]) -> FloatArray:
    """(F, ...) of the estimates; NaN where there is none, as for an attitude that is not estimated."""
    out = np.full((len(steps), *shape), np.nan)
    for i, step in enumerate(steps):
        value = None if step.estimate is None else getattr(step.estimate, name)
        if value is not None:
            corner = tuple(slice(side) for side in value.shape)
            out[i][corner] = value
    return out


def _innovations(steps: Sequence[Step]) -> tuple[FloatArray, IntArray, IntArray]:
    nis = np.full(len(steps), np.nan)
    dof, rejected = np.zeros(len(steps), np.int64), np.zeros(len(steps), np.int64)
    position = {step.readings.index: i for i, step in enumerate(steps)}
    for step in steps:
        for index, innovation in step.innovations.items():
            i = position[index]
            nis[i], dof[i], rejected[i] = innovation.nis, innovation.dof, innovation.rejected
    return nis, dof, rejected


@dataclass(frozen=True)
class SinglePose:
    """What a frame's own pose says of the motion.

    Attributes:
        r_rtn_m: (3,) the chaser relative to the target, RTN axes.
        covariance_m2: (3, 3) of it, as far as it comes from the pose.
        q_eci_from_body: (4,) the target's attitude.
    """

    r_rtn_m: FloatArray
    covariance_m2: FloatArray
    q_eci_from_body: FloatArray


def single_pose(readings: Readings, row: Trajectory) -> SinglePose | None:
    """The pose of one image alone as seen from the orbit; None where the frame has none.

    Args:
        row: the target's orbit at the frame, one row.
    """
    if readings.pose_alone is None:
        return None
    R_eci_from_cam = matrix_from_quaternion(readings.q_eci_from_camera)
    R_rtn_from_eci = R_eci_from_rtn(row.r_target_eci_m[0], row.v_target_eci_m_s[0]).T
    R_rtn_from_cam = R_rtn_from_eci @ R_eci_from_cam
    return SinglePose(
        -R_rtn_from_cam @ readings.pose_alone.t_body_cam_m,
        R_rtn_from_cam @ readings.pose_alone.covariance[3:, 3:] @ R_rtn_from_cam.T,
        quaternion_from_matrix(R_eci_from_cam @ readings.pose_alone.R_cam_from_body),
    )


def _singles(steps: Sequence[Step]) -> tuple[FloatArray, FloatArray]:
    """(F, 3) positions in RTN axes and (F, 4) attitudes by the frames' own poses; NaN without one."""
    r_rtn_m, q = np.full((len(steps), 3), np.nan), np.full((len(steps), 4), np.nan)
    for i, step in enumerate(steps):
        pose = single_pose(step.readings, step.row)
        if pose is not None:
            r_rtn_m[i], q[i] = pose.r_rtn_m, pose.q_eci_from_body
    return r_rtn_m, q
