"""Flights made by hand: motion by Hill's equations, estimates drawn from a known covariance.

The errors of the estimates are drawn from their own covariance, independently at each frame, so the NEES
has the χ² distribution. Nothing here comes from the program's own dynamics, and rotations are SciPy's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._model.flight_record import FlightRecord
from posse_core._model.trajectory import Trajectory

MEAN_MOTION_RAD_S = 1.06e-3
STEP_S = 20.0
WAYPOINTS = np.array([[0.0, -60.0, 0.0], [0.0, -25.0, 0.0], [0.0, -12.0, 0.0]])
ARRIVAL_S = np.array([600.0, 1100.0, 1600.0])
HELD_UNTIL_S = np.array([600.0, 1200.0, 1800.0])
START_M = np.array([8.0, -120.0, 6.0])
OMEGA_BODY_RAD_S = np.array([0.002, -0.001, 0.004])
FIRST_ESTIMATE = 2
"""The navigator has no estimate before this frame."""
SIGMAS = np.repeat([4e-3, 6e-5, 5e-3, 2e-4], 3)
"""Standard deviations of position, velocity, attitude and rate; the first two grow with the range."""
SINGLE_M, SINGLE_RAD = 0.02, 0.03
"""Standard deviations of a single frame's pose; the first is for a metre of range."""
KEEP_OUT_M = np.array([6.0, 8.0, 6.0])
CONE = np.array([0.0, -1.0, 0.0, np.deg2rad(15), 60.0])


@dataclass(frozen=True)
class Motion:
    """F frames of truth, and the impulse after each."""

    t_s: np.ndarray
    rtn: np.ndarray
    dv_rtn_m_s: np.ndarray
    q_eci_from_body: np.ndarray
    omega_body_rad_s: np.ndarray


def hill(t_s: float) -> np.ndarray:
    """(6, 6) transition matrix of Hill's equations, by Clohessy and Wiltshire (1960)."""
    n, s, c = MEAN_MOTION_RAD_S, np.sin(MEAN_MOTION_RAD_S * t_s), np.cos(MEAN_MOTION_RAD_S * t_s)
    return np.array(
        [
            [4 - 3 * c, 0, 0, s / n, 2 * (1 - c) / n, 0],
            [6 * (s - n * t_s), 1, 0, 2 * (c - 1) / n, 4 * s / n - 3 * t_s, 0],
            [0, 0, c, 0, 0, s / n],
            [3 * n * s, 0, 0, c, 2 * s, 0],
            [6 * n * (c - 1), 0, 0, -2 * s, 4 * c - 3, 0],
            [0, 0, -n * s, 0, 0, c],
        ]
    )


def approach() -> Motion:
    """From ``START_M`` to each waypoint by two impulses, with impulses that hold it while it is held."""
    t_s = np.arange(0.0, HELD_UNTIL_S[-1] + STEP_S / 2, STEP_S)
    state, rtn, dv = np.r_[START_M, 0.0, 0.0, 0.0], [], []
    for t in t_s:
        rtn.append(state)
        dv.append(_impulse(t, state))
        state = hill(STEP_S) @ np.r_[state[:3], state[3:] + dv[-1]]
    turns = Rotation.from_rotvec(np.outer(t_s, OMEGA_BODY_RAD_S))
    return Motion(
        t_s=t_s,
        rtn=np.array(rtn),
        dv_rtn_m_s=np.array(dv),
        q_eci_from_body=turns.as_quat()[:, [3, 0, 1, 2]],
        omega_body_rad_s=np.tile(OMEGA_BODY_RAD_S, (len(t_s), 1)),
    )


def scenario(motion: Motion, every: int) -> dict[str, Any]:
    """A scenario of ``small_run``'s box with this motion; only every so many frames are imaged."""
    burns = [
        {"t_s": float(t), "dv_rtn_m_s": np.round(dv, 15).tolist()}  # what is left of zero is none
        for t, dv in zip(motion.t_s[:-1], motion.dv_rtn_m_s[:-1], strict=True)
        if dv.any()
    ]
    start = {"r_m": motion.rtn[0, :3].tolist(), "v_m_s": motion.rtn[0, 3:].tolist()}
    a_m = (3.986004418e14 / MEAN_MOTION_RAD_S**2) ** (1 / 3)
    elements = {"epoch_utc": "2022-01-31T02:02:27.58", "a_m": a_m, "e": 0.0, "i_deg": 98}
    elements |= {"raan_deg": 10, "argp_deg": 0, "mean_anomaly_deg": 30}
    return {
        "target": {"mesh": "box.obj", "scale_m_per_unit": 0.5, "body_axes": "x y z"},
        "orbit": {"elements": elements},
        "relative": {"state_rtn": start, "plan": {"burns": burns}},
        "times": {"t_s": motion.t_s[::every].tolist()},
        "attitude": {"target": {"law": "spin", "body_axis": "+y"}},
        "camera": {"width_px": 160, "height_px": 120},
        "sky": {"earth": False, "stars": None},
        "renderer": {"name": "raster"},
        "seed": 3,
    }


def as_flown(motion: Motion, trajectory: Trajectory) -> Motion:
    """The frames of a dataset's trajectory, with the impulses of the motion that it was made of."""
    rows = np.searchsorted(motion.t_s, trajectory.t_s)
    return Motion(
        t_s=trajectory.t_s,
        rtn=np.hstack([trajectory.r_chaser_rtn_m, trajectory.v_chaser_rtn_m_s]),
        dv_rtn_m_s=motion.dv_rtn_m_s[rows],
        q_eci_from_body=trajectory.q_eci_from_body,
        omega_body_rad_s=trajectory.omega_body_rad_s,
    )


def _impulse(t_s: float, state: np.ndarray) -> np.ndarray:
    """At the start and at each waypoint towards the next one; at each frame while one is held."""
    arrived = int(np.searchsorted(ARRIVAL_S, t_s, side="right")) - 1
    if arrived >= 0 and t_s < HELD_UNTIL_S[arrived]:
        goal, duration = WAYPOINTS[arrived], STEP_S
    elif t_s in (0.0, *HELD_UNTIL_S[:-1]):
        goal, duration = WAYPOINTS[arrived + 1], ARRIVAL_S[arrived + 1] - t_s
    elif t_s == HELD_UNTIL_S[-1]:
        return -state[3:]
    else:
        return np.zeros(3)
    phi = hill(duration)
    return np.linalg.solve(phi[:3, 3:], goal - phi[:3, :3] @ state[:3]) - state[3:]


def correlation() -> np.ndarray:
    """(12, 12) correlations of the errors, none of them zero."""
    mixed = np.random.default_rng(5).normal(size=(12, 12)) + 3 * np.eye(12)
    product = mixed @ mixed.T
    scale = np.sqrt(np.diag(product))
    return product / np.outer(scale, scale)


def flight_record(motion: Motion, seed: int = 0, error_scale: float = 1.0) -> FlightRecord:
    """A flight of this motion.

    Args:
        error_scale: the errors are so many times as large as their covariance says.
    """
    random = np.random.default_rng(seed)
    frames = len(motion.t_s)
    range_m = np.linalg.norm(motion.rtn[:, :3], axis=1)
    sigma = np.tile(SIGMAS, (frames, 1))
    sigma[:, :6] *= range_m[:, None]
    covariance = sigma[:, :, None] * correlation() * sigma[:, None, :]
    unit_errors = random.multivariate_normal(np.zeros(12), correlation(), frames)
    error = error_scale * sigma * unit_errors
    true = Rotation.from_quat(motion.q_eci_from_body[:, [1, 2, 3, 0]])
    estimated = true * Rotation.from_rotvec(-error[:, 6:9])
    single = true * Rotation.from_rotvec(random.normal(scale=SINGLE_RAD, size=(frames, 3)))
    single_m = random.normal(size=(frames, 3)) * SINGLE_M * range_m[:, None]
    record = FlightRecord(
        t_s=motion.t_s,
        r_true_rtn_m=motion.rtn[:, :3],
        v_true_rtn_m_s=motion.rtn[:, 3:],
        q_true_eci_from_body=motion.q_eci_from_body,
        omega_true_body_rad_s=motion.omega_body_rad_s,
        r_rtn_m=motion.rtn[:, :3] - error[:, :3],
        v_rtn_m_s=motion.rtn[:, 3:] - error[:, 3:6],
        q_eci_from_body=estimated.as_quat(canonical=True)[:, [3, 0, 1, 2]],
        omega_body_rad_s=motion.omega_body_rad_s - error[:, 9:],
        covariance=covariance,
        r_single_rtn_m=motion.rtn[:, :3] + single_m,
        q_single_eci_from_body=single.as_quat(canonical=True)[:, [3, 0, 1, 2]],
        burn_s=motion.t_s,
        dv_commanded_rtn_m_s=motion.dv_rtn_m_s,
        dv_rtn_m_s=motion.dv_rtn_m_s,
        nis=random.chisquare(16, frames),
        dof=np.full(frames, 16),
        rejected=np.where(np.arange(frames) % 13 == 7, 2, 0),
        t_waypoint_s=ARRIVAL_S,
        until_waypoint_s=HELD_UNTIL_S,
        r_waypoint_rtn_m=WAYPOINTS,
        v_waypoint_rtn_m_s=np.zeros_like(WAYPOINTS),
        keep_out_m=KEEP_OUT_M,
        cone=CONE,
        least_dv_m_s=np.array(0.8 * np.linalg.norm(motion.dv_rtn_m_s, axis=1).sum()),
    )
    return without_readings(without_estimate(record, slice(0, FIRST_ESTIMATE)), slice(0, None, 9))


def rows(record: FlightRecord, frames: slice) -> FlightRecord:
    """The part of a flight at some frames."""
    once = {"t_waypoint_s", "until_waypoint_s", "r_waypoint_rtn_m", "v_waypoint_rtn_m_s"}
    once |= {"keep_out_m", "cone", "least_dv_m_s"}
    return replace(record, **{k: array[frames] for k, array in record.arrays().items() if k not in once})


def without_estimate(record: FlightRecord, frames: slice) -> FlightRecord:
    """The same flight without an estimate at some frames."""
    names = ("r_rtn_m", "v_rtn_m_s", "q_eci_from_body", "omega_body_rad_s", "covariance")
    return _erased(record, names, frames)


def without_readings(record: FlightRecord, frames: slice) -> FlightRecord:
    """The same flight without readings, and so without a pose of their own, at some frames."""
    erased = _erased(record, ("r_single_rtn_m", "q_single_eci_from_body", "nis"), frames)
    dof, rejected = record.dof.copy(), record.rejected.copy()
    dof[frames] = rejected[frames] = 0
    return replace(erased, dof=dof, rejected=rejected)


def _erased(record: FlightRecord, names: tuple[str, ...], frames: slice) -> FlightRecord:
    arrays = {name: getattr(record, name).copy() for name in names}
    for array in arrays.values():
        array[frames] = np.nan
    return replace(record, **arrays)
