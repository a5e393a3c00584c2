"""What the page of a flight draws: plots over time, poses in the camera, and what stands in space."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from posse_core._arrays import AnyArray, FloatArray
from posse_core._evaluation.flight import FlightErrors, nees_band, spent_m_s
from posse_core._frames import (
    R_eci_from_rtn,
    R_with_z,
    matrix_from_quaternion,
    quaternion_from_matrix,
)
from posse_core._model.flight_record import FlightRecord
from posse_core._model.trajectory import Trajectory

_DIGITS = 6
"""Significant ones of a number in the page."""
_RIM_POINTS = 48


@dataclass(frozen=True)
class TimePlot:
    """One value over the frames.

    Attributes:
        title, unit: plain text.
        values: (F,).
        band: (F, 2) where the value is expected to be, or None.
        dots: (F,) further values that are not joined, such as those of single frames, or None.
        level: a value to compare with, or None.
        shape: ``line``, ``steps`` (a value holds until the next frame) or ``stems``.
        logarithmic: the axis; values must be above 0.
    """

    title: str
    unit: str
    values: FloatArray
    band: FloatArray | None = None
    dots: FloatArray | None = None
    level: float | None = None
    shape: str = "line"
    logarithmic: bool = False

    def as_json(self) -> dict[str, Any]:
        """With null for NaN."""
        arrays = {name: as_numbers(getattr(self, name)) for name in ("values", "band", "dots")}
        return {**asdict(self), **arrays, "level": as_numbers(self.level)}


def time_plots(record: FlightRecord, errors: FlightErrors) -> list[TimePlot]:
    """The plots, three in a row; those of what was not estimated are left out."""
    sigma = errors.sigma
    plots = [
        TimePlot(
            f"Position error, {axis}",
            "m",
            errors.r_rtn_m[:, i],
            _three_sigma(sigma[:, i]),
            dots=errors.r_single_rtn_m[:, i],
        )
        for i, axis in enumerate("RTN")
    ]
    plots += [
        TimePlot(
            f"Velocity error, {axis}",
            "mm/s",
            1e3 * errors.v_rtn_m_s[:, i],
            _three_sigma(1e3 * sigma[:, 3 + i]),
        )
        for i, axis in enumerate("RTN")
    ]
    for first, title, unit, error in (
        (6, "Attitude error", "°", errors.attitude_rad),
        (9, "Rate error", "°/s", errors.omega_body_rad_s),
    ):
        plots += [
            TimePlot(
                f"{title}, {axis}",
                unit,
                np.degrees(error[:, i]),
                _three_sigma(np.degrees(sigma[:, first + i])),
            )
            for i, axis in enumerate("xyz")
        ]
    frames = len(record)
    measured = record.dof > 0
    dof = np.maximum(record.dof, 1)
    nis_band = np.stack([chi2.ppf(0.025, dof), chi2.ppf(0.975, dof)], axis=-1) / dof[:, None]
    size = 1e3 * np.linalg.norm(record.dv_rtn_m_s, axis=-1)
    commanded = 1e3 * np.linalg.norm(record.dv_commanded_rtn_m_s, axis=-1)
    plots += [
        _nees("NEES of position and velocity", errors.nees_6, 6),
        _nees("NEES with attitude and rate", errors.nees_12, 12),
        TimePlot(
            "NIS over its degrees of freedom",
            "",
            np.where(measured, record.nis / dof, np.nan),
            np.where(measured[:, None], nis_band, np.nan),
            level=1.0,
            logarithmic=True,
        ),
        TimePlot("Range", "m", np.linalg.norm(record.r_true_rtn_m, axis=-1)),
    ]
    if commanded.any():
        plots += [
            TimePlot(
                "Impulse", "mm/s", size, dots=np.where(commanded > 0, commanded, np.nan), shape="stems"
            ),
            TimePlot(
                "Δv so far",
                "mm/s",
                1e3 * spent_m_s(record),
                level=1e3 * float(record.least_dv_m_s),
                shape="steps",
            ),
        ]
    assert all(len(plot.values) == frames for plot in plots)
    return [plot for plot in plots if np.isfinite(plot.values).any()]


def _three_sigma(sigma: FloatArray) -> FloatArray:
    return np.stack([-3 * sigma, 3 * sigma], axis=-1)


def _nees(title: str, values: FloatArray, dof: int) -> TimePlot:
    band = np.tile(nees_band(dof), (len(values), 1))
    return TimePlot(title, "", values, band, level=float(dof), logarithmic=True)


def in_space(record: FlightRecord) -> dict[str, Any]:
    """What the projections show, RTN axes: paths, covariances, waypoints, limits and impulses.

    ``covariance_m2`` has the upper triangle RR, RT, RN, TT, TN, NN of each frame.
    """
    rows, columns = np.triu_indices(3)
    keep_out = record.keep_out_m if np.isfinite(record.keep_out_m).all() else None
    return {
        "t_s": as_numbers(record.t_s),
        "true_rtn_m": as_numbers(record.r_true_rtn_m),
        "estimate_rtn_m": as_numbers(record.r_rtn_m),
        "covariance_m2": as_numbers(record.covariance[:, rows, columns]),
        "dv_rtn_m_s": as_numbers(record.dv_rtn_m_s),
        "dof": record.dof.tolist(),
        "rejected": record.rejected.tolist(),
        "waypoints_rtn_m": as_numbers(record.r_waypoint_rtn_m),
        "waypoints_s": as_numbers(np.stack([record.t_waypoint_s, record.until_waypoint_s], axis=-1)),
        "keep_out_m": as_numbers(keep_out),
        "cone_rtn_m": as_numbers(cone_points(record.cone)),
    }


def cone_points(cone: FloatArray) -> FloatArray | None:
    """(1 + n, 3) apex and points of the rim of the approach cone, RTN axes; None where there is none.

    Args:
        cone: (5,) as in :class:`posse_core.FlightRecord`.
    """
    if not np.isfinite(cone).all():
        return None
    turn = np.linspace(0, 2 * np.pi, _RIM_POINTS, endpoint=False)
    sine, cosine = np.sin(cone[3]), np.full(_RIM_POINTS, np.cos(cone[3]))
    rim = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1)
    axes = R_with_z(cone[:3] / np.linalg.norm(cone[:3]))
    return np.concatenate([np.zeros((1, 3)), cone[4] * rim @ axes.T])


@dataclass(frozen=True)
class CameraPoses:
    """Poses of the target in the camera at F frames; NaN where there is none.

    Attributes:
        q_cam_from_body: (F, 4) scalar first.
        t_body_cam_m: (F, 3).
    """

    q_cam_from_body: FloatArray
    t_body_cam_m: FloatArray

    def at(self, index: int) -> dict[str, Any] | None:
        """The pose of a frame, its attitude null if it has a position alone; None if it has none."""
        t = as_numbers(self.t_body_cam_m[index])
        return None if None in t else {"q": _whole(self.q_cam_from_body[index]), "t": t}


def camera_poses(
    trajectory: Trajectory, r_rtn_m: FloatArray, q_eci_from_body: FloatArray
) -> CameraPoses:
    """Where a chaser at ``r_rtn_m`` (F, 3) with the camera's true attitude sees the target.

    Args:
        trajectory: of the target and of the camera's attitude.
        q_eci_from_body: (F, 4) of the target; NaN where it is not known.
    """
    R_cam_from_eci = np.swapaxes(matrix_from_quaternion(trajectory.q_eci_from_camera), -1, -2)
    R_rtn = R_eci_from_rtn(trajectory.r_target_eci_m, trajectory.v_target_eci_m_s)
    q = np.full((len(trajectory), 4), np.nan)
    known = np.isfinite(q_eci_from_body).all(axis=-1)
    q[known] = quaternion_from_matrix(
        R_cam_from_eci[known] @ matrix_from_quaternion(q_eci_from_body[known])
    )
    return CameraPoses(q, -np.einsum("fij,fjk,fk->fi", R_cam_from_eci, R_rtn, r_rtn_m))


def _whole(row: FloatArray) -> Any:
    """The numbers of a row; None if one is missing."""
    return as_numbers(row) if np.isfinite(row).all() else None


def as_numbers(values: AnyArray | float | None) -> Any:
    """Numbers as nested lists with few digits, None for NaN, for JSON."""
    if values is None:
        return None
    array = np.asarray(values, dtype=np.float64)
    if array.ndim:
        return [as_numbers(row) for row in array]
    return float(f"{array:.{_DIGITS}g}") if np.isfinite(array) else None
