"""The pose of the spacecraft in a photograph from clicked points, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._detection.fitting import MIN_POINTS
from posse_core._detection.pnp import solve_pose
from posse_core._frames import turn_rad
from posse_core._interfaces.detector import PoseEstimate
from posse_core._model.camera import Camera
from posse_core._model.spacecraft import Spacecraft
from posse_core._photos.points import PhotoPoints

ENOUGH_POINTS = 6
"""With fewer, a wrong point can go unnoticed."""
MOST_ATTITUDE_RAD = np.radians(5.0)
MOST_POSITION = 0.05
"""Largest standard deviation of an attitude about any axis, and of a position in any direction as a
share of the range, with which a pose is a label."""
_LINE, _PLANE = 1e-3, 0.1
"""Points are on a line, or in a plane, if they are no farther from it, as a share of their extent."""
_SURE = 9.0
"""By so much the sums of squared residuals, in variances, differ where one of two poses is surely the
true one: three standard deviations."""
_MOST_PAIRS = 200


@dataclass(frozen=True)
class PhotoPose:
    """What the points of a photograph give.

    Attributes:
        photo: name of the photograph.
        names: (K,) of the keypoints that were clicked.
        points_px: (K, 2) where they were clicked.
        pose: of the spacecraft; None if the points do not give one.
        residuals_px: (K, 2) where points were clicked minus where the pose puts them; NaN without one.
        faults: what is wrong, in words that follow the photograph's name.
        remark: what one should know of a pose without faults; empty for nothing.
    """

    photo: str
    names: tuple[str, ...]
    points_px: FloatArray
    pose: PoseEstimate | None
    residuals_px: FloatArray
    faults: tuple[str, ...] = ()
    remark: str = ""

    @property
    def rms_px(self) -> float:
        """Root mean square of the residuals of a coordinate, of the points that agree with the pose."""
        assert self.pose is not None
        return float(np.sqrt(np.mean(self.residuals_px[self.pose.inliers] ** 2)))


def solve_photo(
    photo: str, points: PhotoPoints, craft: Spacecraft, camera: Camera, sigma_px: float
) -> PhotoPose:
    """The pose by :func:`posse_core._detection.pnp.solve_pose`, with every joint at zero.

    A pose that the points do not fix is none: fewer than four, or four that agree, on one line, in a
    plane that fits two attitudes, or with an uncertainty above :data:`MOST_ATTITUDE_RAD` or
    :data:`MOST_POSITION`. A point beyond 3 √2 standard deviations from where the pose puts it is left
    out of it, and named; so are two points whose exchange would make all agree.

    Args:
        photo: its name.
        points: at least one.
        craft: whose keypoints they are.
        camera: of the photograph.
        sigma_px: standard deviation of each coordinate of a click.
    """
    names = tuple(points)
    points_px = np.array([points[name] for name in names])
    body_m = np.array([craft.keypoints_body_m[name] for name in names])

    def without(fault: str) -> PhotoPose:
        nothing = np.full_like(points_px, np.nan)
        return PhotoPose(photo, names, points_px, None, nothing, (fault,))

    if len(names) < MIN_POINTS:
        return without(
            f"has {len(names)} of the {MIN_POINTS} points that a pose needs; {ENOUGH_POINTS} show which"
            " are wrong"
        )
    extent = np.linalg.svd(body_m - body_m.mean(axis=0), compute_uv=False)
    if extent[1] <= _LINE * extent[0]:
        return without(f"{_listed(names)} are on one line; add a point beside it")
    pose = solve_pose(body_m, points_px, np.full(len(names), sigma_px), camera)
    exchanged = (
        "" if pose and pose.inliers.all() else _exchanged(names, body_m, points_px, sigma_px, camera)
    )
    if pose is None:
        return without(
            exchanged
            or f"no pose fits {MIN_POINTS} of its points; look at names and places of {_listed(names)}"
        )
    residuals_px = points_px - camera.project(body_m @ pose.R_cam_from_body.T + pose.t_body_cam_m)
    unclear = _two_attitudes(body_m[pose.inliers], points_px[pose.inliers], sigma_px, camera)
    unclear = unclear or _unclear(pose)
    if unclear:
        return without(exchanged or unclear)
    faults = tuple(
        f"{name} is {_distance(offset)} px from where the other points put it; place it again"
        for name, offset, agrees in zip(names, residuals_px, pose.inliers, strict=True)
        if not agrees
    )
    few = len(names) < ENOUGH_POINTS
    remark = f"has {len(names)} points; a wrong one shows from {ENOUGH_POINTS} on" if few else ""
    return PhotoPose(
        photo, names, points_px, pose, residuals_px, (exchanged,) if exchanged else faults, remark
    )


def _exchanged(
    names: tuple[str, ...],
    body_m: FloatArray,
    points_px: FloatArray,
    sigma_px: float,
    camera: Camera,
) -> str:
    """Names the two points whose exchange makes all agree; nothing if no pair does, or several do."""
    pairs = list(combinations(range(len(names)), 2))
    found = []
    for a, b in pairs if len(pairs) <= _MOST_PAIRS else ():
        order = list(range(len(names)))
        order[a], order[b] = b, a
        pose = solve_pose(body_m, points_px[order], np.full(len(names), sigma_px), camera)
        if pose is not None and pose.inliers.all():
            found.append((a, b))
    if len(found) != 1:
        return ""
    one, other = (names[k] for k in found[0])
    return f"{one} and {other} are exchanged: all points agree once each has the other's name"


def _unclear(pose: PoseEstimate) -> str:
    """Says how uncertain a pose is, if it is too uncertain for a label."""
    attitude_rad = float(np.sqrt(np.linalg.eigvalsh(pose.covariance[:3, :3])[-1]))
    position = float(np.sqrt(np.linalg.eigvalsh(pose.covariance[3:, 3:])[-1])) / pose.range_m
    if attitude_rad <= MOST_ATTITUDE_RAD and position <= MOST_POSITION:
        return ""
    return (
        f"its points fix the attitude to {np.degrees(attitude_rad):.1f}° and the position to"
        f" {100 * position:.1f} % of the range only; add points far from the others"
    )


def _two_attitudes(body_m: FloatArray, points_px: FloatArray, sigma_px: float, camera: Camera) -> str:
    """Says that points near a plane fit two attitudes about equally well, if they do.

    Both poses begin with those of the infinitesimal plane-based method (Collins and Bartoli 2014), as
    though the points were in the plane, and are refined with the points as they are.
    """
    middle_m = body_m - body_m.mean(axis=0)
    _, extent, axes = np.linalg.svd(middle_m)
    if extent[2] > _PLANE * extent[0]:
        return ""
    axes[2] *= np.linalg.det(axes)
    own_m = np.ascontiguousarray(middle_m @ axes.T)
    straight = np.ascontiguousarray(camera.rays(points_px)[:, :2])
    found, *starts, _ = cv2.solvePnPGeneric(
        own_m * [1.0, 1.0, 0.0], straight, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    if found < 2:
        return ""
    squares, attitudes = [], []
    for start in zip(*starts, strict=True):
        rotation, t_m = cv2.solvePnPRefineLM(own_m, straight, np.eye(3), None, *start)
        R = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
        away_px = camera.project(np.asarray(own_m @ R.T + t_m[:, 0])) - points_px
        squares.append(float(np.sum(away_px**2)) / sigma_px**2)
        attitudes.append(R)
    angle_rad = turn_rad(*attitudes)
    best, other = sorted(squares)
    # Not so, if the second is NaN since it puts a point behind the camera.
    if angle_rad < MOST_ATTITUDE_RAD or not other - best < _SURE:
        return ""
    return (
        f"its points are about in one plane and fit two attitudes, {np.degrees(angle_rad):.0f}° apart;"
        " add a point off the plane"
    )


def _listed(names: tuple[str, ...]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _distance(offset_px: FloatArray) -> str:
    length_px = float(np.linalg.norm(offset_px))
    return f"{length_px:.1f}" if np.isfinite(length_px) else "too many"
