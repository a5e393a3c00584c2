"""Random numbers of a sensor: Gaussian and Poisson draws of whole images, in float32."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import Float32Array, IntArray

POISSON_BELOW_E = 64.0
"""Above this mean, Poisson noise is drawn as a Gaussian of the same mean and variance, which is 20 times
faster."""
GAUSSIAN_READ_E = 4.0
"""From this read noise r, the sum of it and of any Poisson noise of mean m is drawn as a Gaussian: its
skewness m / (m + r²)^1.5 and its excess kurtosis m / (m + r²)² are at most those of a Poisson variable
of mean POISSON_BELOW_E."""
_MOST = 0.9
"""Of a block whose pixels are mostly dark, the few bright ones are drawn as Poisson variables, too."""
_CLEAR_SIGMA = 10.0
"""A pixel whose mean is further below the full well than this is never limited by it: p = 10⁻²³."""


def normal(random: np.random.Generator, count: int) -> Float32Array:
    """(count,) standard Gaussian draws, by Box and Muller (1958, Ann. Math. Stat. 29, 610).

    NumPy evaluates logarithm and cosine of many numbers at once, so this takes a quarter of the time of
    its own ``standard_normal``. From uniform numbers of 32 bits no draw is beyond 6.8.
    """
    half = (count + 1) // 2
    bits = random.integers(0, 2**64, half, dtype=np.uint64).view(np.uint32)
    radius = bits[:half].astype(np.float32)
    radius += np.float32(0.5)
    radius *= np.float32(2.0**-32)
    np.log(radius, out=radius)
    radius *= np.float32(-2)
    np.sqrt(radius, out=radius)
    angle = bits[half:].astype(np.float32)
    angle *= np.float32(2 * np.pi * 2.0**-32)
    drawn = np.empty(2 * half, dtype=np.float32)
    np.multiply(np.cos(angle), radius, out=drawn[:half])
    np.multiply(np.sin(angle), radius, out=drawn[half:])
    return drawn[:count]


def poisson(mean: Float32Array, random: np.random.Generator) -> IntArray:
    """Poisson draws with the given means: (n,) → (n,)."""
    # Where events are fewer than pixels, they are drawn and not the pixels' counts. Those of the darkest
    # pixel's mean fall anywhere. Those beyond it are drawn at one rate in all pixels, of which each
    # keeps its own share (Lewis & Shedler 1979, Naval Res. Logist. 26, 403). Pixels that would need a
    # higher rate are drawn one by one.
    n, floor = len(mean), mean.min()
    beyond = mean - floor
    rate = np.float32(2) * np.minimum(beyond, np.float32(1)).mean()
    if floor + rate > 1:
        return random.poisson(mean)
    counts = np.bincount(random.integers(n, size=random.poisson(floor * n)), minlength=n)
    if rate > 0:
        pixels = random.integers(n, size=random.poisson(rate * n))
        chance = random.random(len(pixels), dtype=np.float32)
        chance *= rate
        counts += np.bincount(pixels[chance < beyond[pixels]], minlength=n)
        bright = np.flatnonzero(beyond > rate)
        counts[bright] = random.poisson(mean[bright])
    return counts


def shot(mean_e: Float32Array, random: np.random.Generator) -> Float32Array:
    """Electrons that are counted where this many are expected: (n,) → (n,), with photon noise."""
    few = mean_e < POISSON_BELOW_E
    share = np.count_nonzero(few) / len(mean_e)
    if share > _MOST:
        return poisson(mean_e, random).astype(np.float32)
    drawn = np.sqrt(mean_e)
    drawn *= normal(random, len(mean_e))
    drawn += mean_e
    if share > 0:
        drawn[few] = poisson(mean_e[few], random)
    return drawn


def detected(
    mean_e: Float32Array, full_well_e: float, read_e: float, random: np.random.Generator
) -> Float32Array:
    """Electrons with photon noise, limited by the full well, and then with read noise: (n,) → (n,).

    Where both noises are Gaussian and no limit comes between them, one draw has both variances.
    """
    apart = mean_e > full_well_e - _CLEAR_SIGMA * np.sqrt(full_well_e)
    if read_e < GAUSSIAN_READ_E:
        apart |= mean_e < POISSON_BELOW_E
    share = np.count_nonzero(apart) / len(mean_e)
    if share > _MOST:
        return read(shot(mean_e, random), full_well_e, read_e, random)
    drawn = mean_e + np.float32(read_e**2)
    np.sqrt(drawn, out=drawn)
    drawn *= normal(random, len(mean_e))
    drawn += mean_e
    if share > 0:
        drawn[apart] = read(shot(mean_e[apart], random), full_well_e, read_e, random)
    return drawn


def read(
    electrons: Float32Array, full_well_e: float, read_e: float, random: np.random.Generator
) -> Float32Array:
    """Limit electrons (n,) by the full well and add read noise, in place; returns them."""
    np.minimum(electrons, np.float32(full_well_e), out=electrons)
    if read_e:
        electrons += np.float32(read_e) * normal(random, len(electrons))
    return electrons
