"""Poses fitted to keypoints by weighted least squares, several at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._frames import cross_matrix, matrix_from_rotation_vector
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera

MIN_POINTS = 4
"""Smallest number of points; three allow several poses."""
_HUBER = 2.0  # standard deviations beyond which a point's influence no longer grows
_STEPS = 30
_SETTLED = 1e-6
"""Steps end where the cost falls by less than this share: by far less than a pose is uncertain."""
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-12, 1e-4, 1e8


class Points(NamedTuple):
    """Keypoints as each of N poses explains them.

    Attributes:
        body_m: (K, 3) in body axes; one that is NaN agrees with no pose.
        px: (N, K, 2) where they are seen.
        sigma_px: (N, K) standard deviation of each coordinate.
        agree: (N, K) those whose residuals count.
    """

    body_m: FloatArray
    px: FloatArray
    sigma_px: FloatArray
    agree: BoolArray

    def of(self, chosen: BoolArray) -> Points:
        """Those of some of the poses (N,)."""
        return Points(self.body_m, self.px[chosen], self.sigma_px[chosen], self.agree[chosen])


class _Linearised(NamedTuple):
    """The cost of N poses, and how it changes.

    Attributes:
        cost: (N,) Huber's; infinite where a point that counts is not in front of the camera, or beyond
            the reach of its lens.
        normal: (N, 6, 6) normal matrix by a small rotation and the position.
        slope: (N, 6) the negative gradient.
    """

    cost: FloatArray
    normal: FloatArray
    slope: FloatArray


def fitted_poses(
    R_cam_from_body: FloatArray, t_body_cam_m: FloatArray, points: Points, camera: Camera
) -> list[PoseEstimate | None]:
    """Minimise the residuals of the points that agree, of each pose for itself.

    Levenberg and Marquardt's steps minimise the residuals, each divided by its standard deviation, with
    Huber weights.

    Args:
        R_cam_from_body, t_body_cam_m: (N, 3, 3) and (N, 3) the poses to start from.
        points: those of each pose.
        camera: that sees them.

    Returns:
        The poses; None for one with fewer than four points near their projections, or with a point that
        agrees and is not in front of the camera.
    """
    R, t = np.array(R_cam_from_body, np.float64), np.array(t_body_cam_m, np.float64)
    now = _linearised(R, t, points, camera)
    damping = np.full(len(R), _FIRST_DAMPING)
    moves = np.isfinite(now.cost)
    for _ in range(_STEPS):
        if not moves.any():
            break
        normal, slope = now.normal[moves], now.slope[moves]
        diagonal = damping[moves, None] * np.diagonal(normal, axis1=1, axis2=2)
        damped = normal + diagonal[..., None] * np.eye(6)
        step = np.asarray(np.linalg.solve(damped, slope[..., None])[..., 0], np.float64)
        R_new, t_new = matrix_from_rotation_vector(step[:, :3]) @ R[moves], t[moves] + step[:, 3:]
        new = _linearised(R_new, t_new, points.of(moves), camera)
        is_less = new.cost < now.cost[moves]
        is_settled = is_less & (now.cost[moves] - new.cost < _SETTLED * now.cost[moves])
        moved = np.flatnonzero(moves)[is_less]
        R[moved], t[moved] = R_new[is_less], t_new[is_less]
        for old, value in zip(now, new, strict=True):
            old[moved] = value[is_less]
        factor = np.where(is_less, 0.1, 10.0)
        damping[moves] = np.maximum(damping[moves] * factor, _LEAST_DAMPING)
        moves[moves] = ~is_settled & (damping[moves] <= _MOST_DAMPING)
    distance = distance_px(R, t, points.body_m, points.px, camera) / points.sigma_px
    return [
        _estimate(R[n], t[n], now.normal[n], distance[n]) if np.isfinite(now.cost[n]) else None
        for n in range(len(R))
    ]


def distance_px(
    R_cam_from_body: FloatArray,
    t_body_cam_m: FloatArray,
    points_body_m: FloatArray,
    points_px: FloatArray,
    camera: Camera,
) -> FloatArray:
    """How far points (K, 3) are seen from where poses (..., 3, 3) and (..., 3) put them: (..., K), px.

    It is infinite behind the camera and beyond the reach of its lens.
    """
    placed_m = points_body_m @ np.swapaxes(R_cam_from_body, -1, -2) + t_body_cam_m[..., None, :]
    away_px = np.linalg.norm(camera.project(placed_m) - points_px, axis=-1)
    return np.asarray(np.nan_to_num(away_px, nan=np.inf))


def _estimate(
    R: FloatArray, t: FloatArray, normal: FloatArray, distance: FloatArray
) -> PoseEstimate | None:
    """A pose with its uncertainty.

    Args:
        R, t: the pose.
        normal: (6, 6) normal matrix.
        distance: (K,) from the points to their projections, in standard deviations.
    """
    inliers = distance < 3.0 * np.sqrt(2.0)
    if inliers.sum() < MIN_POINTS or t[2] <= 0:
        return None
    covariance = np.asarray(np.linalg.pinv(normal), np.float64)
    residual = float(np.sqrt(np.mean(distance[inliers] ** 2) / 2))
    return PoseEstimate(R, t, covariance, inliers, residual)


def _linearised(R: FloatArray, t: FloatArray, points: Points, camera: Camera) -> _Linearised:
    counts = points.agree
    # Points that do not count may be unknown: they are put where every pose sees something.
    turned_m = np.where(counts[..., None], points.body_m @ np.swapaxes(R, 1, 2), 0.0)
    placed_m = np.where(counts[..., None], turned_m + t[:, None], np.array([0.0, 0.0, 1.0]))
    away_px = np.where(counts[..., None], camera.project(placed_m) - points.px, 0.0)
    seen = ~np.isnan(away_px).any(axis=(1, 2))
    by_position = camera.project_jacobian(placed_m)
    # A rotation by w moves a point p by w × p = −p × w.
    by_rotation = by_position @ -cross_matrix(turned_m)
    sigma_px = np.where(counts, points.sigma_px, np.inf)[..., None]
    jacobian = np.concatenate([by_rotation, by_position], axis=-1) / sigma_px[..., None]
    residual = away_px / sigma_px
    distance = np.linalg.norm(residual, axis=-1)
    weight = np.minimum(1.0, _HUBER / np.maximum(distance, 1e-12))[..., None]
    by_point = np.where(distance <= _HUBER, distance**2 / 2, _HUBER * (distance - _HUBER / 2))
    flat = len(R), 2 * len(points.body_m)
    weighted = np.swapaxes((jacobian * weight[..., None]).reshape(*flat, 6), 1, 2)
    slope = -(weighted @ residual.reshape(*flat, 1))[..., 0]
    cost = np.where(seen, by_point.sum(axis=1), np.inf)
    return _Linearised(cost, weighted @ jacobian.reshape(*flat, 6), slope)
