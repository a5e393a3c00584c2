"""Poses from keypoints and their uncertainties: a closed-form start, then weighted least squares."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._frames import cross_matrix
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera

MIN_POINTS = 4
"""Smallest number of points; three allow several poses."""
_HUBER = 2.0  # standard deviations beyond which a point's influence no longer grows
_STEPS = 30
_SETTLED = 1e-6
"""Steps end where the cost falls by less than this share: by far less than a pose is uncertain."""


def solve_pose(
    points_body_m: FloatArray, points_px: FloatArray, sigma_px: FloatArray, camera: Camera
) -> PoseEstimate | None:
    """Estimate the pose that projects points of the body to pixels.

    RANSAC with P3P (Ke and Roumeliotis 2017) finds the points that agree on a pose, and OpenCV's closed
    forms give initial poses from these. Levenberg–Marquardt then minimises the residuals, each divided
    by its standard deviation, with Huber weights. Coplanar keypoints are handled like any others.

    Args:
        points_body_m: (K, 3) points in body axes; those that are NaN are left out.
        points_px: (K, 2) their pixels.
        sigma_px: (K,) standard deviation of each coordinate.
        camera: the camera.

    Returns:
        The pose, or None if fewer than four points are given or agree on a pose.
    """
    points_body_m = np.asarray(points_body_m, np.float64)
    points_px, sigma_px = np.asarray(points_px, np.float64), np.asarray(sigma_px, np.float64)
    start = _start(points_body_m, points_px, sigma_px, camera)
    return None if start is None else fitted_pose(*start, points_body_m, points_px, sigma_px, camera)


def fitted_pose(
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    agree: BoolArray,
    points_body_m: FloatArray,
    points_px: FloatArray,
    sigma_px: FloatArray,
    camera: Camera,
) -> PoseEstimate | None:
    """Minimise the residuals of points that agree on a pose; see :func:`solve_pose`.

    Args:
        R_cam_from_body, t_body_cam_m: (3, 3) and (3,) the pose to start from.
        agree: (K,) the points whose residuals count; four or more.
        points_body_m, points_px, sigma_px: (K, 3), (K, 2) and (K,) all points.
        camera: the camera.

    Returns:
        The pose, or None if fewer than four points are near their projections.
    """
    R, t = R_cam_from_body, t_body_cam_m
    everything = points_body_m, points_px, sigma_px
    points_body_m, points_px, sigma_px = (a[agree] for a in everything)
    damping = 1e-4
    cost, J, r, weights = _linearised(R, t, points_body_m, points_px, sigma_px, camera)
    for _ in range(_STEPS):
        H = (J * weights[:, None]).T @ J
        slope = -J.T @ (weights * r)
        step = np.asarray(np.linalg.solve(H + damping * np.diag(np.diag(H)), slope), np.float64)
        R_new, t_new = np.asarray(cv2.Rodrigues(step[:3])[0]) @ R, t + step[3:]
        new = _linearised(R_new, t_new, points_body_m, points_px, sigma_px, camera)
        if new[0] < cost:
            done = cost - new[0] < _SETTLED * cost
            R, t, (cost, J, r, weights) = R_new, t_new, new
            damping = max(damping / 10, 1e-12)
            if done:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    points_body_m, points_px, sigma_px = everything
    distance = _distance_px(R, t, points_body_m, points_px, camera) / sigma_px
    inliers = distance < 3.0 * np.sqrt(2.0)
    if inliers.sum() < MIN_POINTS or t[2] <= 0:
        return None
    covariance = np.asarray(np.linalg.pinv((J * weights[:, None]).T @ J), np.float64)
    residual = float(np.sqrt(np.mean(distance[inliers] ** 2) / 2))
    return PoseEstimate(R, t, covariance, inliers, residual)


def _start(
    points_body_m: FloatArray, points_px: FloatArray, sigma_px: FloatArray, camera: Camera
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Return an initial attitude and position, and which points (K,) agree with them."""
    straight_px, largest = through_a_pinhole(points_px, camera)
    seen = np.flatnonzero(
        (np.isfinite(straight_px).all(axis=1)) & np.isfinite(points_body_m).all(axis=1)
    )
    if len(seen) < MIN_POINTS:
        return None
    cv2.setRNGSeed(0)  # so that RANSAC gives the same pose for the same points
    threshold_px = float(3.0 * np.median(sigma_px) + 1.0)
    try:
        found, _, _, indices = cv2.solvePnPRansac(
            points_body_m[seen],
            straight_px[seen],
            camera.matrix,
            None,
            flags=cv2.SOLVEPNP_AP3P,
            reprojectionError=largest * threshold_px,
            iterationsCount=200,
        )
    except cv2.error:  # raised if no three points determine a pose
        return None
    if not found or len(indices) < MIN_POINTS:
        return None
    chosen = seen[indices[:, 0]]
    starts = [
        (float(np.median(_distance_px(R, t, points_body_m, points_px, camera)[chosen])), i, R, t)
        for i, (R, t) in enumerate(_closed_forms(points_body_m[chosen], straight_px[chosen], camera))
    ]
    if not starts:
        return None
    _, _, R, t = min(starts)
    distance_px = _distance_px(R, t, points_body_m, points_px, camera)
    agree = (
        distance_px < threshold_px + 5.0 * sigma_px
    )  # uncertain points contribute with their low weight
    return (R, t, agree) if agree.sum() >= MIN_POINTS else None


def through_a_pinhole(points_px: FloatArray, camera: Camera) -> tuple[FloatArray, float]:
    """Return the positions (K, 2) at which a pinhole with the camera's matrix images what the camera
    images at the points, and by how much a pixel is enlarged there at most.

    A position is NaN where the lens images nothing. OpenCV's solvers know no fisheye.
    """
    if camera.distortion is None:
        return points_px, 1.0
    rays = camera.rays(points_px)
    xx, xy, yy = camera.distortion.jacobian(rays[:, 0], rays[:, 1])
    least = np.nanmin((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy), initial=1.0)
    return (rays @ camera.matrix.T)[:, :2], float(1 / least)


def _closed_forms(
    points_body_m: FloatArray, points_px: FloatArray, camera: Camera
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield poses by two methods, since each fails in some cases.

    SQPnP (Terzakis and Lourakis 2020) fails for some coplanar points, and OpenCV's iterative method,
    which starts from a DLT or a homography, for some noise.
    """
    for method in (cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_ITERATIVE):
        try:
            found, rotation, t = cv2.solvePnP(
                points_body_m,
                points_px,
                camera.matrix,
                None,
                flags=method,
            )
        except cv2.error:  # DLT needs six points
            continue
        if found and t[2, 0] > 0 and np.isfinite(rotation).all():
            yield np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(t[:, 0], np.float64)


def _distance_px(
    R: FloatArray, t: FloatArray, points_body_m: FloatArray, points_px: FloatArray, camera: Camera
) -> FloatArray:
    away = camera.project(points_body_m @ R.T + t) - points_px
    # NaN where a point is behind the camera or outside the domain of its lens
    return np.asarray(np.nan_to_num(np.linalg.norm(away, axis=1), nan=np.inf))


def _linearised(
    R: FloatArray,
    t: FloatArray,
    points_body_m: FloatArray,
    points_px: FloatArray,
    sigma_px: FloatArray,
    camera: Camera,
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Return Huber cost, Jacobian (2K, 6) by rotation and position, residuals (2K,), weights (2K,).

    Residuals are in standard deviations.
    """
    turned = points_body_m @ R.T
    away_px = camera.project(turned + t) - points_px
    z = (turned + t)[:, 2]
    if np.isnan(away_px).any():
        return np.inf, np.zeros((2 * len(z), 6)), np.zeros(2 * len(z)), np.zeros(2 * len(z))
    by_position = camera.project_jacobian(turned + t)
    # A rotation by w moves a point p by w × p = −p × w.
    by_rotation = by_position @ -cross_matrix(turned)
    J = np.concatenate([by_rotation, by_position], axis=2) / sigma_px[:, None, None]
    r = away_px / sigma_px[:, None]
    distance = np.linalg.norm(r, axis=1)
    weights = np.minimum(1.0, _HUBER / np.maximum(distance, 1e-12))
    cost = np.where(distance <= _HUBER, distance**2 / 2, _HUBER * (distance - _HUBER / 2)).sum()
    return float(cost), J.reshape(-1, 6), r.reshape(-1), np.repeat(weights, 2)
