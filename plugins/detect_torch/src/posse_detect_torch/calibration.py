"""Standard deviations of keypoints that their errors on the valid part confirm."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.stats import chi2

from posse_core import Float32Array, FloatArray

_START = np.array([0.0, 0.5, -0.5])
_LIMITS = ((-10.0, 10.0), (0.0, 1.5), (-3.0, 0.0))
"""Of a, b and c: a point is less certain the wider and the smaller its peak is, also where few errors of
a short training say otherwise."""
_FREEDOM = 4.0
_SCALE = 0.8310
"""Scale of Student's distribution of so many degrees of freedom that is most likely for errors of a
standard deviation of 1 that are normally distributed."""
_FEWEST_POSES = 20
"""From so many poses their median error is known well enough."""
_MOST_WIDENING = 3.0


def widening(nees: FloatArray) -> float:
    """Return the factor on standard deviations that makes the covariances of poses honest.

    Keypoints of one picture are wrong together, where it shows little, so that each may be as uncertain
    as it says and the pose be less certain than they say. The factor takes the median of the normalised
    estimation errors squared to that of χ² with six degrees of freedom; a mean would be that of the few
    poses that are upside down.

    Args:
        nees: (N,) of poses on the valid part; with few, nothing is known and the factor is 1.
    """
    if len(nees) < _FEWEST_POSES:
        return 1.0
    return float(np.clip(np.sqrt(np.median(nees) / chi2.ppf(0.5, 6)), 1.0, _MOST_WIDENING))


def calibrate(away_px: FloatArray, spread_px: FloatArray, share: FloatArray) -> Float32Array:
    """Find how the standard deviation of a coordinate follows from what a network says of a point.

    The logarithm of the standard deviation is a + b log(spread) + c log(share). The three are those of
    greatest likelihood by Student's distribution, whose tails give little weight to keypoints that are
    at none of their places (Lange et al. 1989); the poses, which follow, leave these out.

    Args:
        away_px: (N, 2) errors of the points, each at the place that is nearest to the true one.
        spread_px: (N,) spread of the network's distribution there.
        share: (N,) share of the distribution that is there, 0 … 1.

    Returns:
        (3,) a, b and c.
    """
    terms = np.column_stack([np.ones(len(share)), np.log(spread_px), np.log(share)])
    squared = np.asarray(away_px, np.float64) ** 2 / _FREEDOM

    def cost(weights: FloatArray) -> tuple[float, FloatArray]:
        log_scale = (terms @ weights + np.log(_SCALE))[:, None]
        ratio = squared * np.exp(-2 * log_scale)
        loss = log_scale + (_FREEDOM + 1) / 2 * np.log1p(ratio)
        by_log_scale = 1 - (_FREEDOM + 1) * ratio / (1 + ratio)
        return float(loss.sum() / len(share)), by_log_scale.sum(axis=1) @ terms / len(share)

    found = minimize(cost, _START, jac=True, method="L-BFGS-B", bounds=_LIMITS)
    return np.asarray(found.x, np.float32)
