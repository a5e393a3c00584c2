"""How well a flight was navigated and flown: errors, their consistency, and what it cost.

An error of the estimate is truth minus estimate, as its covariance defines it
(:class:`posse_core.Estimate`). The normalised estimation error squared (NEES) eᵀ P⁻¹ e of a consistent
navigator has the χ² distribution with as many degrees of freedom as e has components (Bar-Shalom, Li and
Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from posse_core._arrays import BoolArray, FloatArray
from posse_core._frames import matrix_from_quaternion, rotation_vector_from_matrix
from posse_core._model.flight_record import FlightRecord

_LEAST_RATE_RAD_S = 1e-4
"""A rate that is smaller has no relative error: a turn takes seventeen hours."""
MOTION_DOF = 6
"""Components of position and velocity."""
THREE_SIGMA_SHARE = float(norm.cdf(3) - norm.cdf(-3))
"""Probability that a normal variable is within 3σ, 99.73 %."""


@dataclass(frozen=True)
class FlightErrors:
    """Errors of the estimate and of the single-frame poses at the F frames; NaN where there is none.

    Attributes:
        r_rtn_m, v_rtn_m_s: (F, 3) of position and velocity, RTN axes.
        attitude_rad: (F, 3) small rotation θ in body axes, R_true = R_estimate · exp(θ×).
        omega_body_rad_s: (F, 3) of the target's angular velocity, body axes.
        sigma: (F, 12) standard deviations of the four, from the covariance.
        nees_6: (F,) NEES of position and velocity; NaN too where their covariance is singular.
        nees_12: (F,) NEES of all four, likewise.
        r_single_rtn_m: (F, 3) error of the position by the frame's own pose.
        single_rad: (F,) angle between the true attitude and that of the frame's own pose.
    """

    r_rtn_m: FloatArray
    v_rtn_m_s: FloatArray
    attitude_rad: FloatArray
    omega_body_rad_s: FloatArray
    sigma: FloatArray
    nees_6: FloatArray
    nees_12: FloatArray
    r_single_rtn_m: FloatArray
    single_rad: FloatArray


@dataclass(frozen=True)
class FlightSummary:
    """The key figures of a flight; NaN where there is nothing to measure.

    Attributes:
        final_position_error_m, final_velocity_error_m_s: distance of the true state at the last frame
            from the last waypoint.
        final_range_m: true distance between chaser and target at the last frame.
        position_error_95_m, velocity_error_95_m_s: 95th percentile of the true state's distance from
            the last waypoint, over the frames at which it is to be held.
        dv_m_s: sum of the impulses that were carried out.
        least_dv_m_s: that of the best plan that knows everything.
        closest_m: least true distance between chaser and target at a frame.
        entered_keep_out: whether the chaser was inside the keep-out ellipsoid at a frame.
        lost_s: the longest time for which the navigator was lost. It is lost at a frame if it has no
            estimate, or if the true position is outside the ellipsoid that the covariance expects it in
            with the probability of 3σ, 99.73 %. A frame stands for the time until the next one, the last
            frame for as much as the one before it.
        median_position_error_m: of the estimate, over all frames with an estimate.
        median_single_position_error_m: of the frames' own poses, over all frames with one.
        median_paired_position_error_m: of the estimate, over the frames with a pose of their own; it is
            the one to compare with the median before.
        final_estimate_position_error_m, final_estimate_velocity_error_m_s: of the estimate at the last
            frame.
        attitude_error_rad: angle of the estimate's attitude error at the last frame.
        rate_error: error of the target's angular velocity at the last frame, over its true size; NaN
            for a target that hardly turns, by less than 1e-4 rad/s.
        nees_final: NEES of position and velocity at the last frame.
        nees_in_band: whether it is within the two-sided 95 % band of its χ² distribution.
        nees_share: share of the frames in this band, of those with a NEES.
    """

    final_position_error_m: float
    final_velocity_error_m_s: float
    final_range_m: float
    position_error_95_m: float
    velocity_error_95_m_s: float
    dv_m_s: float
    least_dv_m_s: float
    closest_m: float
    entered_keep_out: bool
    lost_s: float
    median_position_error_m: float
    median_single_position_error_m: float
    median_paired_position_error_m: float
    final_estimate_position_error_m: float
    final_estimate_velocity_error_m_s: float
    attitude_error_rad: float
    rate_error: float
    nees_final: float
    nees_in_band: bool
    nees_share: float


def flight_errors(record: FlightRecord, symmetries: Sequence[FloatArray] = ()) -> FlightErrors:
    """The errors at each frame.

    Args:
        symmetries: (3, 3) turns of the body that leave its looks. The true body axes are taken to be
            those that are nearest to the estimated ones, at each frame.
    """
    S = _nearest_turn(record.q_true_eci_from_body, record.q_eci_from_body, symmetries)
    R_true = _matrices(record.q_true_eci_from_body)
    r, v = record.r_true_rtn_m - record.r_rtn_m, record.v_true_rtn_m_s - record.v_rtn_m_s
    attitude = _rotation_vectors(_matrices(record.q_eci_from_body), R_true @ S)
    omega = np.einsum("fji,fj->fi", S, record.omega_true_body_rad_s) - record.omega_body_rad_s
    S_single = _nearest_turn(record.q_true_eci_from_body, record.q_single_eci_from_body, symmetries)
    single = _rotation_vectors(_matrices(record.q_single_eci_from_body), R_true @ S_single)
    P = record.covariance
    return FlightErrors(
        r_rtn_m=r,
        v_rtn_m_s=v,
        attitude_rad=attitude,
        omega_body_rad_s=omega,
        sigma=_sigma(P),
        nees_6=nees(np.concatenate([r, v], axis=-1), P[:, :MOTION_DOF, :MOTION_DOF]),
        nees_12=nees(np.concatenate([r, v, attitude, omega], axis=-1), P),
        r_single_rtn_m=record.r_true_rtn_m - record.r_single_rtn_m,
        single_rad=np.linalg.norm(single, axis=-1),
    )


def nees(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised estimation error squared, eᵀ P⁻¹ e.

    Args:
        error: (F, n).
        covariance: (F, n, n).

    Returns:
        (F,); NaN where a number is missing or the covariance is not positive definite.
    """
    sigma = _sigma(covariance)
    known = np.isfinite(error).all(axis=-1) & np.isfinite(covariance).all(axis=(-2, -1))
    known &= (sigma > 0).all(axis=-1)
    # Correlations have one scale, while variances of position and rate differ by many powers of ten.
    scaled = error[known] / sigma[known]
    correlation = covariance[known] / (sigma[known][:, :, None] * sigma[known][:, None, :])
    values, vectors = np.linalg.eigh(correlation)
    definite = values[:, 0] > error.shape[-1] * np.finfo(np.float64).eps
    along = np.einsum("fij,fi->fj", vectors, scaled)
    result = np.full(len(error), np.nan)
    result[np.flatnonzero(known)[definite]] = np.sum(along[definite] ** 2 / values[definite], axis=-1)
    return result


def _sigma(covariance: FloatArray) -> FloatArray:
    """(F, n, n) → (F, n) standard deviations; 0 for a variance below it."""
    return np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 0.0))


def nees_band(dof: int) -> tuple[float, float]:
    """Ends of the two-sided 95 % band of χ² with so many degrees of freedom."""
    low, high = chi2.ppf((0.025, 0.975), dof)
    return float(low), float(high)


def spent_m_s(record: FlightRecord) -> FloatArray:
    """(F,) sum of the sizes of the impulses up to and with the one after each frame."""
    return np.cumsum(np.linalg.norm(record.dv_rtn_m_s, axis=-1))


def summarise(record: FlightRecord, symmetries: Sequence[FloatArray] = ()) -> FlightSummary:
    """The key figures of a flight of at least one frame.

    Args:
        symmetries: as in :func:`flight_errors`.
    """
    errors = flight_errors(record, symmetries)
    away_m, away_m_s = _from_last_waypoint(record)
    held = _held(record)
    range_m = np.linalg.norm(record.r_true_rtn_m, axis=-1)
    error_m = np.linalg.norm(errors.r_rtn_m, axis=-1)
    single_m = np.linalg.norm(errors.r_single_rtn_m, axis=-1)
    omega_true = float(np.linalg.norm(record.omega_true_body_rad_s[-1]))
    omega_error = float(np.linalg.norm(errors.omega_body_rad_s[-1]))
    in_band = in_nees_band(errors.nees_6, MOTION_DOF)
    known = np.isfinite(errors.nees_6)
    return FlightSummary(
        final_position_error_m=float(away_m[-1]),
        final_velocity_error_m_s=float(away_m_s[-1]),
        final_range_m=float(range_m[-1]),
        position_error_95_m=percentile(away_m[held], 95),
        velocity_error_95_m_s=percentile(away_m_s[held], 95),
        dv_m_s=float(spent_m_s(record)[-1]),
        least_dv_m_s=float(record.least_dv_m_s),
        closest_m=float(range_m.min()),
        entered_keep_out=bool(inside_keep_out(record).any()),
        lost_s=longest_s(lost(record, errors), record.t_s),
        median_position_error_m=percentile(error_m, 50),
        median_single_position_error_m=percentile(single_m, 50),
        median_paired_position_error_m=percentile(error_m[np.isfinite(single_m)], 50),
        final_estimate_position_error_m=float(error_m[-1]),
        final_estimate_velocity_error_m_s=float(np.linalg.norm(errors.v_rtn_m_s[-1])),
        attitude_error_rad=float(np.linalg.norm(errors.attitude_rad[-1])),
        rate_error=omega_error / omega_true if omega_true > _LEAST_RATE_RAD_S else np.nan,
        nees_final=float(errors.nees_6[-1]),
        nees_in_band=bool(in_band[-1]),
        nees_share=float(in_band[known].mean()) if known.any() else np.nan,
    )


def in_nees_band(values: FloatArray, dof: int) -> BoolArray:
    """(F,) whether each NEES is in its :func:`nees_band`; False for NaN."""
    low, high = nees_band(dof)
    return np.asarray((values >= low) & (values <= high))


def inside_keep_out(record: FlightRecord) -> BoolArray:
    """(F,) whether the chaser is inside the keep-out ellipsoid; False where there is none."""
    return np.asarray(np.sum((record.r_true_rtn_m / record.keep_out_m) ** 2, axis=-1) < 1)


def lost(record: FlightRecord, errors: FlightErrors) -> BoolArray:
    """(F,) whether the navigator is lost at a frame, as :class:`FlightSummary` defines it.

    An estimate whose covariance is singular, such as one that is taken from the truth, is lost where
    its position is in error by more than three times the root of the trace.
    """
    distance = nees(errors.r_rtn_m, record.covariance[:, :3, :3])
    limit = chi2.ppf(THREE_SIGMA_SHARE, 3)
    singular = np.isnan(distance)
    error_m = np.linalg.norm(errors.r_rtn_m, axis=-1)
    sigma_m = np.linalg.norm(errors.sigma[:, :3], axis=-1)
    return np.asarray(np.where(singular, ~(error_m <= 3 * sigma_m), distance > limit))


def longest_s(marked: BoolArray, t_s: FloatArray) -> float:
    """The longest time without a gap for which frames are marked."""
    if len(t_s) < 2:
        return 0.0
    steps = np.diff(t_s)
    longest = current = 0.0
    for mark, step in zip(marked, [*steps, steps[-1]], strict=True):
        current = current + float(step) if mark else 0.0
        longest = max(longest, current)
    return longest


def _from_last_waypoint(record: FlightRecord) -> tuple[FloatArray, FloatArray]:
    """(F,) and (F,) distance of true position and velocity from the last waypoint; NaN without one."""
    if not len(record.t_waypoint_s):
        nothing = np.full(len(record), np.nan)
        return nothing, nothing
    away_m = np.linalg.norm(record.r_true_rtn_m - record.r_waypoint_rtn_m[-1], axis=-1)
    away_m_s = np.linalg.norm(record.v_true_rtn_m_s - record.v_waypoint_rtn_m_s[-1], axis=-1)
    return away_m, away_m_s


def _held(record: FlightRecord) -> BoolArray:
    """(F,) whether the last waypoint is to be held at a frame."""
    if not len(record.t_waypoint_s):
        return np.zeros(len(record), dtype=np.bool_)
    t_s = record.t_s
    return np.asarray((t_s >= record.t_waypoint_s[-1]) & (t_s <= record.until_waypoint_s[-1]))


def percentile(values: FloatArray, percent: float) -> float:
    """Percentile of the values that are numbers; NaN if none is."""
    values = values[np.isfinite(values)]
    return float(np.percentile(values, percent)) if len(values) else np.nan


def _matrices(q: FloatArray) -> FloatArray:
    """(F, 4) → (F, 3, 3), NaN for NaN."""
    R = np.full((len(q), 3, 3), np.nan)
    known = np.isfinite(q).all(axis=-1)
    R[known] = matrix_from_quaternion(q[known])
    return R


def _rotation_vectors(R_from: FloatArray, R_to: FloatArray) -> FloatArray:
    """(F, 3) θ in body axes with R_to = R_from · exp(θ×); NaN for NaN."""
    R = np.swapaxes(R_from, -1, -2) @ R_to
    rotation = np.full(R.shape[:-1], np.nan)
    known = np.isfinite(R).all(axis=(-2, -1))
    rotation[known] = rotation_vector_from_matrix(R[known])
    return rotation


def _nearest_turn(
    q_true: FloatArray, q_other: FloatArray, symmetries: Sequence[FloatArray]
) -> FloatArray:
    """(F, 3, 3) the turn of the body, identity or a symmetry, with the least angle at each frame."""
    turns = np.stack([np.eye(3), *symmetries])
    R = np.nan_to_num(np.swapaxes(_matrices(q_other), -1, -2) @ _matrices(q_true))
    # The trace of a rotation is the larger the smaller its angle.
    trace = np.einsum("fij,sji->fs", R, turns)
    return np.asarray(turns[np.argmax(trace, axis=-1)])
