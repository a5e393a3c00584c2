"""The poses that keypoints may agree on, where each of them may be at several places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._detection.fitting import MIN_POINTS, Points, fitted_poses
from posse_core._detection.pnp import solve_pose, through_a_pinhole
from posse_core._frames import turn_rad
from posse_core._interfaces.detector import Detection, KeypointPlaces, PoseEstimate
from posse_core._model.camera import Camera
from posse_core._randomness import random_generator

_APART_RAD = np.radians(20)
"""Poses that differ by more are told apart."""
_TRIPLES = 300
_WIDER = 0.02
"""Three keypoints give a pose that is about right: others are expected this share of the extent of all
places about their projections."""
_ANYWHERE = 0.1
"""Probability that a keypoint is at none of its places, whatever the network says."""
_TRIED, _KEPT, _AT_ONCE = 60, 6, 12
"""So many of the poses of three keypoints are fitted at most, until so many are found; and so many at
once."""
_ROUNDS = 2
_TEMPER = 0.25
"""Keypoints of one image err together: so much of the logarithm of their likelihood counts."""


def poses_of(points_body_m: FloatArray, found: Detection, camera: Camera) -> list[PoseEstimate]:
    """Find the poses on which the keypoints of a detection may agree.

    Poses of three keypoints, each at one of its places (P3P, Ke and Roumeliotis 2017), are ordered by
    the likelihood of all places; the best that differ are fitted to the places near their projections.

    Args:
        points_body_m: (K, 3) keypoints in body axes.
        found: with keypoints and their standard deviations. Without places, one pose is sought by
            :func:`posse_core._detection.pnp.solve_pose`.
        camera: that took the image.

    Returns:
        The poses, most likely first, each with the keypoints at the places that fit it. The sum of their
        certainties is 1.
    """
    if found.keypoints_px is None or found.keypoints_sigma_px is None:
        return []
    if found.places is None:
        pose = solve_pose(points_body_m, found.keypoints_px, found.keypoints_sigma_px, camera)
        return [] if pose is None else [replace(pose, detection=found)]
    mixture = _Mixture(np.asarray(points_body_m, np.float64), found.places, camera)
    R, t = mixture.of_triples()
    scores = mixture.log_likelihood(R, t, wider=True)
    poses: list[PoseEstimate] = []
    left = np.argsort(-scores, kind="stable")[:_TRIED].tolist()
    while left and len(poses) < _KEPT:
        left = [number for number in left if not is_known(R[number], poses)]
        taken, left = left[:_AT_ONCE], left[_AT_ONCE:]
        for pose in mixture.fitted(R[taken], t[taken], found):
            if len(poses) < _KEPT and not is_known(pose.R_cam_from_body, poses):
                poses.append(pose)
    return weighed(poses, points_body_m, [found], camera)


def weighed(
    poses: Sequence[PoseEstimate], points_body_m: FloatArray, looks: Sequence[Detection], camera: Camera
) -> list[PoseEstimate]:
    """Share one certainty among poses by the likelihood of the keypoints' places, most likely first.

    Args:
        poses: that differ clearly.
        points_body_m: (K, 3) keypoints in body axes.
        looks: detections of one spacecraft with keypoints, found in several squares of the image. Those
            without places say nothing.
        camera: that took the image.
    """
    told = [
        _Mixture(np.asarray(points_body_m, np.float64), look.places, camera).log_likelihood(
            np.array([pose.R_cam_from_body for pose in poses]),
            np.array([pose.t_body_cam_m for pose in poses]),
        )
        for look in looks
        if look.places is not None and poses
    ]
    if not told:
        return list(poses)
    mean = np.mean(told, axis=0)
    chance = np.exp(_TEMPER * (mean - mean.max()))
    chance /= chance.sum()
    made = [replace(pose, certainty=float(c)) for pose, c in zip(poses, chance, strict=True)]
    return sorted(made, key=lambda pose: -pose.certainty)


def is_known(R_cam_from_body: FloatArray, poses: Sequence[PoseEstimate]) -> bool:
    """Whether an attitude (3, 3) differs little from that of one of the poses."""
    return any(turn_rad(R_cam_from_body, pose.R_cam_from_body) < _APART_RAD for pose in poses)


class _Mixture:
    """The distributions of the keypoints' places."""

    def __init__(self, points_body_m: FloatArray, places: KeypointPlaces, camera: Camera) -> None:
        self._points_body_m, self._camera = points_body_m, camera
        self._px = np.asarray(places.points_px, np.float64)
        self._sigma_px = np.asarray(places.sigma_px, np.float64)
        on_body = np.asarray(np.isfinite(points_body_m).all(axis=1))
        known = on_body[:, None] & np.isfinite(self._px).all(axis=2)
        self._share = np.where(known, places.share, 0.0)
        self._px = np.where(known[..., None], self._px, 0.0)
        counted = self._px[self._share > 0]
        extent_px = np.ptp(counted, axis=0).max() if len(counted) else 1.0
        self._extent_px = max(float(extent_px), 1.0)

    def of_triples(self) -> tuple[FloatArray, FloatArray]:
        """Poses (N, 3, 3) and (N, 3) of three keypoints each, drawn by how sure they are."""
        sure = self._share.max(axis=1) / (self._sigma_px[:, 0] + 0.01 * self._extent_px)
        if np.count_nonzero(sure) < MIN_POINTS:
            return np.zeros((0, 3, 3)), np.zeros((0, 3))
        random = random_generator(0, 0, "triples of keypoints")
        with np.errstate(divide="ignore"):
            keys = np.log(sure) + random.gumbel(size=(_TRIPLES, len(sure)))
        triples = np.argpartition(-keys, 3, axis=1)[:, :3]
        sums = np.cumsum(self._share, axis=1)
        draws = random.uniform(size=triples.shape) * sums[triples, -1]
        chosen = np.argmax(sums[triples] > draws[..., None], axis=-1)
        straight_px, _ = through_a_pinhole(self._px.reshape(-1, 2), self._camera)
        points_px = straight_px.reshape(self._px.shape)[triples, chosen]
        Rs, ts = [], []
        for triple, pixels in zip(triples, points_px, strict=True):
            if not np.isfinite(pixels).all():
                continue
            body_m = self._points_body_m[triple]
            try:
                found = cv2.solveP3P(body_m, pixels, self._camera.matrix, None, cv2.SOLVEPNP_AP3P)
            except cv2.error:  # raised if they determine no pose
                continue
            for rotation, t in zip(found[1], found[2], strict=True):
                if t[2, 0] > 0 and np.isfinite(rotation).all():
                    Rs.append(cv2.Rodrigues(rotation)[0])
                    ts.append(t[:, 0])
        return np.reshape(np.asarray(Rs, np.float64), (-1, 3, 3)), np.reshape(
            np.asarray(ts, np.float64), (-1, 3)
        )

    def log_likelihood(self, R: FloatArray, t: FloatArray, *, wider: bool = False) -> FloatArray:
        """(N,) of poses (N, 3, 3) and (N, 3), by all keypoints."""
        inside = self._densities(R, t, _WIDER * self._extent_px if wider else 0.0).sum(axis=2)
        known = self._share.any(axis=1)
        return np.asarray(np.log(inside + self._elsewhere())[:, known].sum(axis=1))

    def fitted(self, R: FloatArray, t: FloatArray, found: Detection) -> list[PoseEstimate]:
        """The poses near some (N, 3, 3) and (N, 3), in their order, fitted to the means of the places
        near their projections. Those on which too few keypoints agree are left out."""
        assert found.keypoints_px is not None
        assert found.keypoints_sigma_px is not None
        poses: list[PoseEstimate] = []
        for number in range(_ROUNDS):
            near = self._densities(R, t, 0.0 if number else _WIDER * self._extent_px)
            agree = near.max(axis=2) > self._elsewhere()
            weight = near / np.maximum(near.sum(axis=2, keepdims=True), np.finfo(float).tiny)
            mean_px = np.einsum("nkm,kmi->nki", weight, self._px)
            mean_sigma_px = np.sqrt(np.einsum("nkm,km->nk", weight, self._sigma_px**2))
            px = np.where(agree[..., None], mean_px, found.keypoints_px)
            sigma_px = np.where(agree, mean_sigma_px, found.keypoints_sigma_px)
            chosen = agree.sum(axis=1) >= MIN_POINTS
            points = Points(self._points_body_m, px, sigma_px, agree).of(chosen)
            made = fitted_poses(R[chosen], t[chosen], points, self._camera)
            poses = [
                replace(
                    pose, detection=replace(found, keypoints_px=own_px, keypoints_sigma_px=own_sigma)
                )
                for pose, own_px, own_sigma in zip(made, points.px, points.sigma_px, strict=True)
                if pose is not None
            ]
            R = np.array([pose.R_cam_from_body for pose in poses]).reshape(-1, 3, 3)
            t = np.array([pose.t_body_cam_m for pose in poses]).reshape(-1, 3)
        return poses

    def _densities(self, R: FloatArray, t: FloatArray, wider_px: float) -> FloatArray:
        """(N, K, M) density of each place at the projections, per px²."""
        seen_px = self._camera.project(self._points_body_m @ np.swapaxes(R, 1, 2) + t[:, None])
        squared = ((seen_px[:, :, None] - self._px) ** 2).sum(axis=-1)
        variance = self._sigma_px**2 + wider_px**2
        density = (1 - _ANYWHERE) * self._share / (2 * np.pi * variance)
        squared = np.nan_to_num(squared, nan=np.inf)  # behind the camera or beyond its lens
        return np.asarray(density * np.exp(-squared / (2 * variance)))

    def _elsewhere(self) -> FloatArray:
        """(K,) density of a keypoint that is at none of its places, per px²."""
        return np.asarray((1 - (1 - _ANYWHERE) * self._share.sum(axis=1)) / self._extent_px**2)
