"""From the steps of a flight to its record and its trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._flight.loop import Step
from posse_core._flight.problem import FlightProblem
from posse_core._frames import R_eci_from_rtn, matrix_from_quaternion, quaternion_from_matrix
from posse_core._interfaces.navigator import Readings
from posse_core._model.flight_record import FlightRecord
from posse_core._model.trajectory import TRAJECTORY_ARRAYS, Trajectory


def joined(rows: Sequence[Trajectory]) -> Trajectory:
    """The trajectory of several rows."""
    arrays = {name: np.concatenate([getattr(row, name) for row in rows]) for name in TRAJECTORY_ARRAYS}
    extras = {name: np.concatenate([row.extras[name] for row in rows]) for name in rows[0].extras}
    return Trajectory(epoch_utc=rows[0].epoch_utc, **arrays, extras=extras)


def flight_record(steps: Sequence[Step], problem: FlightProblem, least_dv_m_s: float) -> FlightRecord:
    """The record of a flight that has ended.

    Args:
        steps: all of its steps.
        problem: of the flight.
        least_dv_m_s: sum of the impulses of the best plan that knows everything.
    """
    truth = joined([step.row for step in steps])
    nis, dof, rejected = _innovations(steps)
    singles = [_single(step.readings, step.row) for step in steps]
    control, safety = problem.control, problem.control.safety
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
        r_single_rtn_m=np.array([r for r, _ in singles]),
        q_single_eci_from_body=np.array([q for _, q in singles]),
        burn_s=np.array([step.burn_s for step in steps]),
        dv_commanded_rtn_m_s=np.array([step.dv_commanded_rtn_m_s for step in steps]),
        dv_rtn_m_s=np.array([step.dv_rtn_m_s for step in steps]),
        nis=nis,
        dof=dof,
        rejected=rejected,
        t_waypoint_s=np.array([point.t_s for point in control.waypoints]),
        until_waypoint_s=np.array([point.until_s for point in control.waypoints]),
        r_waypoint_rtn_m=np.reshape([point.r_rtn_m for point in control.waypoints], (-1, 3)),
        v_waypoint_rtn_m_s=np.reshape([point.v_rtn_m_s for point in control.waypoints], (-1, 3)),
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
    for step in steps:
        for index, innovation in step.innovations.items():
            nis[index], dof[index] = innovation.nis, innovation.dof
            rejected[index] = innovation.rejected
    return nis, dof, rejected


def _single(readings: Readings, row: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Position (3,) in RTN axes and attitude (4,) by the frame's own pose; NaN without one."""
    if readings.pose is None:
        return np.full(3, np.nan), np.full(4, np.nan)
    R_eci_from_cam = matrix_from_quaternion(readings.q_eci_from_camera)
    R_rtn_from_eci = R_eci_from_rtn(row.r_target_eci_m[0], row.v_target_eci_m_s[0]).T
    r_rtn_m = -R_rtn_from_eci @ R_eci_from_cam @ readings.pose.t_body_cam_m
    return r_rtn_m, quaternion_from_matrix(R_eci_from_cam @ readings.pose.R_cam_from_body)
