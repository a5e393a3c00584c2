"""How right poses are: SPEED's errors and scores, ADD and ADI."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from posse_core._arrays import FloatArray
from posse_core._frames import rotation_vector_from_matrix, turn_rad

SpeedVersion = Literal["2019", "2021", "2023"]
_POSITION_FLOOR_SHARE = 0.002173  # of the range: the error of the testbed's own truth in SPEED+
_ATTITUDE_FLOOR_RAD = np.deg2rad(0.169)


def pose_errors(
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    R_found: FloatArray,
    t_found_m: FloatArray,
    symmetries: Sequence[FloatArray] = (),
) -> tuple[float, float]:
    """SPEED's errors of one pose.

    Args:
        R_cam_from_body, t_body_cam_m: (3, 3) and (3,), the truth.
        R_found, t_found_m: the estimate.
        symmetries: (3, 3) turns of the body that leave its looks; the nearest counts.

    Returns:
        e_t = |t − t_found| / |t|, and e_q in radians, the angle between the attitudes.
    """
    t = np.asarray(t_body_cam_m, np.float64)
    e_t = float(np.linalg.norm(t - t_found_m) / np.linalg.norm(t))
    turns = [np.eye(3), *symmetries]
    return e_t, min(turn_rad(R_cam_from_body @ S, R_found) for S in turns)


def nees(
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    R_found: FloatArray,
    t_found_m: FloatArray,
    covariance: FloatArray,
    symmetries: Sequence[FloatArray] = (),
) -> float:
    """Normalised estimation error squared of one pose (Bar-Shalom et al. 2001, section 5.4).

    If the covariance is right, it has a χ² distribution of 6 degrees of freedom: its mean is 6, and 95 %
    of poses are below 12.6.

    Args:
        R_cam_from_body, t_body_cam_m, R_found, t_found_m, symmetries: as of :func:`pose_errors`.
        covariance: (6, 6) of a small rotation in camera axes (rad) and of the position (m).
    """
    turns = [np.eye(3), *symmetries]
    nearest = min((R_cam_from_body @ S for S in turns), key=lambda R: turn_rad(R, R_found))
    away = rotation_vector_from_matrix(R_found @ nearest.T)
    error = np.concatenate([away, np.asarray(t_found_m, np.float64) - t_body_cam_m])
    return float(error @ np.linalg.pinv(covariance) @ error)


def speed_score(e_t: FloatArray, e_q_rad: FloatArray, version: SpeedVersion) -> float:
    """The score of poses; lower is better.

    ``2019``: mean of e_t + e_q (Kisantal et al. 2020). ``2021``: SPEED+, where a pose better than the
    calibration in both counts as exact. ``2023``: SPEED+ since, where each error better than the
    calibration counts as none by itself (Park et al. 2023).

    Args:
        e_t: (N,) relative position error.
        e_q_rad: (N,) error of the attitude.
    """
    e_t, e_q = np.asarray(e_t, np.float64), np.asarray(e_q_rad, np.float64)
    fine_t, fine_q = e_t < _POSITION_FLOOR_SHARE, e_q < _ATTITUDE_FLOOR_RAD
    if version == "2021":
        fine_t = fine_q = fine_t & fine_q
    if version != "2019":
        e_t, e_q = np.where(fine_t, 0.0, e_t), np.where(fine_q, 0.0, e_q)
    return float(np.mean(e_t + e_q))


def add_m(
    points_body_m: FloatArray,
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    R_found: FloatArray,
    t_found_m: FloatArray,
) -> float:
    """Mean distance between the model's points as they are and as they were found (Hinterstoisser et
    al. 2012, eq. 3; ``add`` of the BOP toolkit).

    Args:
        points_body_m: (V, 3) vertices of the model.
        R_cam_from_body, t_body_cam_m: (3, 3) and (3,), the truth.
        R_found, t_found_m: the estimate.
    """
    # The difference of the poses comes first, so that nothing is lost to a long range.
    away = points_body_m @ (R_found - R_cam_from_body).T + (t_found_m - t_body_cam_m)
    return float(np.linalg.norm(away, axis=1).mean())


def adi_m(
    points_body_m: FloatArray,
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    R_found: FloatArray,
    t_found_m: FloatArray,
) -> float:
    """As :func:`add_m`, from each point to the nearest found point, whichever that is: for craft that
    look alike from several sides (eq. 4 there; ADD-S; ``adi`` of the BOP toolkit)."""
    # Vertices that coincide, several at each corner of an STL file, would make the tree 40 times slower.
    points_m, counts = np.unique(points_body_m, axis=0, return_counts=True)
    there = points_m @ R_cam_from_body.T
    found = points_m @ R_found.T + (t_found_m - t_body_cam_m)
    distance, _ = cKDTree(found, leafsize=32, balanced_tree=False).query(there)
    return float(np.average(distance, weights=counts))
