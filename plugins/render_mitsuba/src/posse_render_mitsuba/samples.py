"""How samples are distributed over the pixels, and how they are averaged.

The squared error of an image is least when each pixel gets samples in proportion to its standard
deviation (Neyman allocation, 1934).

The compiled variants estimate the deviations from a first round over all pixels. A pixel's deviation is
estimated from its neighbours only. If its own samples counted, a pixel that was bright by chance would
be sampled again and one that was dark by chance would not, and the image would be biased dark. The
scalar variant estimates the deviation per tile, where one pixel among a thousand matters little.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import correlate, maximum_filter

from posse_core import FloatArray, IntArray

NEIGHBOURS = np.ones((5, 5))
NEIGHBOURS[2, 2] = 0.0
MAX_ROUNDS_FACTOR = 16
"""The most rounds that one pixel may get, as a multiple of the average."""


def further_rounds(variance: FloatArray, covered: FloatArray, rounds: float) -> IntArray:
    """How many rounds each pixel gets after the first one.

    Args:
        variance: (h, w) variance of each pixel's samples in the first round.
        covered: (h, w) positive where samples hit the spacecraft.
        rounds: the average number of rounds per pixel of the spacecraft, the first one included.

    Returns:
        (h, w) further rounds, 0 where no pixel of the spacecraft is near. Their mean over the spacecraft
        is about ``rounds`` − 1.
    """
    result = np.zeros(variance.shape, dtype=np.int64)
    near = maximum_filter(covered, NEIGHBOURS.shape, mode="constant") > 0
    deviation = np.sqrt(correlate(variance, NEIGHBOURS, mode="constant"))[near]
    result[near] = allot(deviation, rounds, least=1, most=MAX_ROUNDS_FACTOR * rounds) - 1
    return result


def allot(deviation: FloatArray, rounds: float, least: float, most: float) -> IntArray:
    """(n,) rounds in proportion to ``deviation`` (n,), between ``least`` and ``most``, with the average
    ``rounds``."""
    if not deviation.any():
        return np.full(len(deviation), int(least))
    # Bisect for the factor of proportionality that makes the average equal to ``rounds``.
    logarithm = np.log(deviation[deviation > 0])
    lowest, highest = np.log(least) - logarithm.max(), np.log(most) - logarithm.min()
    for _ in range(50):
        middle = (lowest + highest) / 2
        spent = np.clip(np.exp(middle) * deviation, least, most).mean()
        lowest, highest = (middle, highest) if spent < rounds else (lowest, middle)
    rounded: IntArray = np.rint(np.clip(np.exp(lowest) * deviation, least, most)).astype(np.int64)
    return rounded


def mean_of_samples(sums: FloatArray, counts: FloatArray) -> FloatArray:
    """(..., 4) mean from ``sums`` (..., 4) over the finite samples and their ``counts`` (...).

    About one in 10⁸ of Mitsuba's samples on metal is not finite; those are left out. The mean is NaN
    where no sample is finite.
    """
    mean = np.full(sums.shape, np.nan)
    np.divide(sums, counts[..., None], out=mean, where=counts[..., None] > 0)
    return mean
