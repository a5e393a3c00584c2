"""Where samples are worth most, and what they come to.

The picture's squared error is least when a pixel has as many samples as its standard deviation asks for
(Neyman's allocation, 1934).

Compiled variants read deviations from a first round over all pixels. A pixel's own samples do not
speak for it, only those around it: did they, a pixel that was bright by chance would be looked at again
and one that was dark by chance would not, and the picture would be too dark. The scalar variant reads
them tile by tile; a pixel has little say among a thousand.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import correlate, maximum_filter

from posse_core import FloatArray, IntArray

NEIGHBOURS = np.ones((5, 5))
NEIGHBOURS[2, 2] = 0.0
MOST_ROUNDS = 16
"""For one pixel, as a multiple of what all have on average."""


def further_rounds(variance: FloatArray, covered: FloatArray, rounds: float) -> IntArray:
    """How many rounds more each pixel is worth.

    Args:
        variance: (h, w) of a pixel's samples in the first round.
        covered: (h, w) share of the samples that met the craft.
        rounds: for a pixel of the craft on average, the first one included.

    Returns:
        (h, w), 0 where nothing is near. Their mean over the craft is about ``rounds`` − 1.
    """
    result = np.zeros(variance.shape, dtype=np.int64)
    near = maximum_filter(covered, NEIGHBOURS.shape, mode="constant") > 0
    deviation = np.sqrt(correlate(variance, NEIGHBOURS, mode="constant"))[near]
    result[near] = allot(deviation, rounds, least=1, most=MOST_ROUNDS * rounds) - 1
    return result


def allot(deviation: FloatArray, rounds: float, least: float, most: float) -> IntArray:
    """(n,) rounds in proportion to the deviations (n,), within limits, and ``rounds`` on average."""
    if not deviation.any():
        return np.full(len(deviation), int(least))
    # The factor with which their average is ``rounds``, or as near as it can be
    logarithm = np.log(deviation[deviation > 0])
    lowest, highest = np.log(least) - logarithm.max(), np.log(most) - logarithm.min()
    for _ in range(50):
        middle = (lowest + highest) / 2
        spent = np.clip(np.exp(middle) * deviation, least, most).mean()
        lowest, highest = (middle, highest) if spent < rounds else (lowest, middle)
    rounded: IntArray = np.rint(np.clip(np.exp(lowest) * deviation, least, most)).astype(np.int64)
    return rounded


def mean_of_samples(sums: FloatArray, counts: FloatArray) -> FloatArray:
    """(..., 4) from sums (..., 4) over the samples that are finite, and how many (...) these are.

    Some of Mitsuba's are not, about one in 10⁸ on metal; they are left out. NaN where there is no other.
    """
    mean = np.full(sums.shape, np.nan)
    np.divide(sums, counts[..., None], out=mean, where=counts[..., None] > 0)
    return mean
