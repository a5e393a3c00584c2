"""Poses from keypoints and their uncertainties: a closed-form start, then weighted least squares."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._detection.fitting import MIN_POINTS, Points, distance_px, fitted_poses
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera


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
    if start is None:
        return None
    R, t, agree = start
    points = Points(points_body_m, points_px[None], sigma_px[None], agree[None])
    return fitted_poses(R[None], t[None], points, camera)[0]


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
        (float(np.median(distance_px(R, t, points_body_m, points_px, camera)[chosen])), i, R, t)
        for i, (R, t) in enumerate(_closed_forms(points_body_m[chosen], straight_px[chosen], camera))
    ]
    if not starts:
        return None
    _, _, R, t = min(starts)
    away_px = distance_px(R, t, points_body_m, points_px, camera)
    agree = away_px < threshold_px + 5.0 * sigma_px  # uncertain points contribute with their low weight
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
