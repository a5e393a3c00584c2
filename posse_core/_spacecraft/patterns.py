"""Random patterns of brightness: what a spacecraft may look like whose materials are not known.

A pattern has patches of one brightness, as of panels, covers and insulation, some of them with lines, as
solar cells have, and soft blobs, as of dirt and of uneven paint.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from posse_core._arrays import FloatArray

_FINEST, _COARSEST = 1.0 / 64.0, 1.0 / 4.0
"""Smallest and largest standard deviation of the blobs, as shares of the texture."""
_PATCHES = (8, 80)
"""Least and largest number of patches."""
_SIDES = (0.03, 0.6)
"""Least and largest side of a patch, as a share of the texture's."""
_CELLS = (1.0 / 48.0, 1.0 / 8.0)
"""Least and largest distance of lines, likewise."""
_LINED = 0.4
"""Share of the patches that have lines."""
_LINE = 0.12
"""Width of a line, as a share of the distance to the next."""
MOST = 3.0
"""Greatest departure from the mean, in standard deviations."""


def log_pattern(shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
    """Return a random pattern (height, width): the logarithm of a texture's factors. It repeats without
    a seam; its mean is 0, its standard deviation 1, and it keeps within ±3.

    Args:
        shape: (height, width) of the texture, texels.
        rng: of all its draws.
    """
    share = float(_between(_FINEST, _COARSEST, rng))
    sigma_px = (share * shape[0], share * shape[1])
    blobs = _standard(gaussian_filter(rng.standard_normal(shape), sigma_px, mode="wrap"))
    patches = np.zeros(shape)
    for _ in range(int(_between(*_PATCHES, rng))):
        _lay(patches, rng)
    weight = rng.uniform(0.5, 0.95)
    mixed = _standard(np.sqrt(weight) * _standard(patches) + np.sqrt(1.0 - weight) * blobs)
    return np.asarray(np.clip(mixed, -MOST, MOST))


def _lay(patches: FloatArray, rng: np.random.Generator) -> None:
    """Lay a rectangle over the patches (height, width)."""
    height, width = patches.shape
    sides = np.maximum(1, np.rint(_between(*_SIDES, rng, 2) * (height, width))).astype(int)
    rows, columns = (
        (rng.integers(size) + np.arange(side)) % size
        for size, side in zip((height, width), sides, strict=True)
    )
    brightness = rng.normal()
    filled = np.full(sides, brightness)
    if rng.uniform() < _LINED:
        line = brightness + rng.normal(scale=2.0)
        for axis, size in enumerate((height, width)):
            distance = max(2.0, float(_between(*_CELLS, rng)) * size)
            on = (np.arange(sides[axis]) / distance) % 1.0 < max(_LINE, 1.0 / distance)
            filled[on if axis == 0 else (slice(None), on)] = line
    patches[np.ix_(rows, columns)] = filled


def _between(low: float, high: float, rng: np.random.Generator, count: int | None = None) -> FloatArray:
    """Random numbers whose logarithm is even between two limits."""
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), count)))


def _standard(values: FloatArray) -> FloatArray:
    return np.asarray((values - values.mean()) / max(float(values.std()), 1e-9))
