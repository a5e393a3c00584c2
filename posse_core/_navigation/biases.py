"""The slow parts of the keypoints' errors as states of the filter.

A network's error at a keypoint depends on how the spacecraft looks, so frames of nearly the same view
have nearly the same error, and averaging them gains little. Each coordinate of each keypoint has a
state for it, a first-order Gauss–Markov process in time, in the turn of the view and in the
logarithm of the range (Gelb 1974, Applied Optimal Estimation, section 3.8), as a share of the target's
diameter in the image.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from posse_core import _frames as frames
from posse_core._arrays import FloatArray, IntArray
from posse_core._navigation.belief import Belief, Biases
from posse_core._navigation.kinematics import SIZE
from posse_core._navigation.options import KalmanOptions


def renewed(
    belief: Belief, points_body_m: FloatArray, R_cam_from_body: FloatArray, options: KalmanOptions
) -> tuple[Belief, IntArray]:
    """The belief with biases for all of a frame's keypoints, correlated with the last frame's as far as
    time, view and range allow.

    Args:
        belief: at the frame's instant.
        points_body_m: (K, 3) the frame's keypoints.
        R_cam_from_body: (3, 3) how the target is seen.
        options: size and correlation.

    Returns:
        The belief, and for each keypoint (K,) which of the biases is its own; none if there are none.
    """
    if options.bias_share == 0:
        return belief, np.empty(0, dtype=np.int64)
    old = belief.biases
    range_m = float(np.linalg.norm(belief.x.dr_eci_m))
    turn = frames.rotation_vector_from_matrix(old.R_cam_from_body.T @ R_cam_from_body)
    kept = math.exp(
        -abs(belief.at.t_s - old.t_s) / options.bias_time_s
        - float(np.linalg.norm(turn)) / math.radians(options.bias_angle_deg)
        - abs(math.log(range_m / old.range_m)) / math.log(options.bias_zoom)
    )
    same = (points_body_m[:, None] == old.points_body_m[None]).all(axis=-1)
    new = ~same.any(axis=1)
    count = len(old.points_body_m)
    slots = np.where(new, count + np.cumsum(new) - 1, np.argmax(np.c_[same, new], axis=1))
    size = SIZE + 2 * (count + int(new.sum()))
    factor = np.ones(len(belief.covariance))
    factor[SIZE:] = kept
    variance = np.zeros(size)
    variance[SIZE:] = (1 - kept**2) * options.bias_share**2
    variance[len(factor) :] = options.bias_share**2
    covariance = np.diag(variance)
    covariance[: len(factor), : len(factor)] += factor[:, None] * belief.covariance * factor
    biases = Biases(
        np.concatenate([old.points_body_m, points_body_m[new]]),
        np.concatenate([kept * old.shares, np.zeros(2 * int(new.sum()))]),
        belief.at.t_s,
        R_cam_from_body,
        range_m,
    )
    return replace(belief, covariance=covariance, biases=biases), slots


def seen(belief: Belief, R_cam_from_body: FloatArray) -> Belief:
    """The belief after a frame, with the view (3, 3) as the frame corrected it.

    From it to the view that is predicted for the next frame is the turn of the motion alone; corrections
    would otherwise count as turns, and the biases as less correlated than they are.
    """
    biases = replace(
        belief.biases,
        R_cam_from_body=R_cam_from_body,
        range_m=float(np.linalg.norm(belief.x.dr_eci_m)),
    )
    return replace(belief, biases=biases)
