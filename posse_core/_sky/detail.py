"""Structure finer than the maps: one tile of noise, repeated over the whole globe."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posse_core import _randomness
from posse_core._arrays import Float32Array
from posse_core._files.cache import cached_array
from posse_core._randomness import random_generator
from posse_core._sky import pyramid as pyramids
from posse_core._sky.atmosphere import RADIUS_M
from posse_core._sky.pyramid import Pyramid

TILE_PX = 1024
TILE_M = 512e3
"""Side of the tile, which repeats. Its noise has wavelengths of 64 km and less."""
TEXEL_M = TILE_M / TILE_PX
_SHARPNESS = 32
"""Power of an axis' share in the vertical, by which projections are blended: within 2° of where two
of them are as close to the vertical."""
_LEAST_WEIGHT = np.float32(0.1)
"""Projections of the tile that would have less weight are left out."""
_TINY = np.float32(1e-30)
_NOWHERE: Float32Array = np.zeros((), dtype=np.float32)


@dataclass(frozen=True)
class Detail:
    """Noise of mean 0 and variance 1 on the globe.

    Attributes:
        tile: float32 with 4 channels: the noise, its slopes to the right and downwards, per km, and its
            square.
    """

    tile: Pyramid

    def at(
        self, normal: Float32Array, log_footprint: Float32Array
    ) -> tuple[Float32Array, Float32Array, list[Float32Array]]:
        """(3, ...) unit vectors, ECEF axes, and (...) binary logarithms of pixel widths in metres → mean
        and variance of the noise in the pixel (...), and its mean slope along the three ECEF axes, per
        km, (...) each. A slope that is zero everywhere has the shape ()."""
        level = log_footprint - np.float32(np.log2(TEXEL_M))
        noise = variance = _NOWHERE
        slope = [_NOWHERE] * 3
        for side, weight in _projections(normal):
            right, down = (side + 1) % 3, (side + 2) % 3
            u = normal[right] * np.float32(RADIUS_M / TILE_M)
            v = normal[down] * np.float32(RADIUS_M / TILE_M)
            u -= np.floor(u)
            v -= np.floor(v)
            sample = self.tile.at(u, v, level)
            sample[3] -= sample[0] * sample[0]
            if weight is not None:
                sample *= weight
                sample[3] *= weight
            noise, variance = noise + sample[0], variance + sample[3]
            slope[right], slope[down] = slope[right] + sample[1], slope[down] + sample[2]
        return noise, variance, slope


def _projections(normal: Float32Array) -> Iterator[tuple[int, Float32Array | None]]:
    """Axes along which the tile is projected at (3, ...) unit vectors, with their weights (...).

    Projections are blended by how close each axis is to the vertical. The weight is None where it is 1
    everywhere, as in most parts of an image.
    """
    reach = np.abs(normal).reshape(3, -1)
    least, most = (x.astype(np.float64) ** _SHARPNESS for x in (reach.min(axis=1), reach.max(axis=1)))
    main = int(least.argmax())
    if most.sum() - most[main] <= _LEAST_WEIGHT * least[main]:
        yield main, None
        return
    weights = np.square(normal)
    for _ in range(int(np.log2(_SHARPNESS)) - 1):
        np.square(weights, out=weights)
    weights -= _LEAST_WEIGHT * weights.sum(axis=0)
    np.maximum(weights, 0, out=weights)
    weights /= np.maximum(weights.sum(axis=0), _TINY)
    for side, weight in enumerate(weights):
        if weight.max() > 0:
            yield side, weight


@functools.lru_cache(maxsize=2)
def make_detail(seed: int) -> Detail:
    """The fine structure for a seed. That of seed 0, which the ground has, and the last other one are in
    the user's cache."""
    name = "detail" if seed else "ground-detail"
    files = (__file__, _randomness.__file__, pyramids.__file__)
    recipe = (*(Path(file).read_bytes() for file in files), repr((seed, np.__version__)).encode())
    sheet = cached_array(name, recipe, lambda: Pyramid(_tile(seed), tiles=True).sheet)
    return Detail(Pyramid.kept(sheet, (TILE_PX, TILE_PX, 4)))


def _tile(seed: int) -> Float32Array:
    """(TILE_PX, TILE_PX, 4) tile as :class:`Detail` has it."""
    random = random_generator(seed, -1, "detail")
    k = np.fft.fftfreq(TILE_PX) * TILE_PX
    norm = np.hypot(k[:, None], k[None, : TILE_PX // 2 + 1])
    norm[0, 0] = 1
    fall = np.where(norm >= 8, norm**-1.7, 0)
    a, b, smooth = (
        np.fft.irfft2(
            fall * np.fft.rfft2(random.standard_normal((TILE_PX, TILE_PX))), s=(TILE_PX, TILE_PX)
        )
        for _ in range(3)
    )
    puffs = np.hypot(a, b)  # round tops separated by sharp clefts
    noise = (puffs - puffs.mean()) / puffs.std() + 0.6 * smooth / smooth.std()
    noise /= noise.std()
    right = (np.roll(noise, -1, axis=1) - np.roll(noise, 1, axis=1)) / (2e-3 * TEXEL_M)
    down = (np.roll(noise, -1, axis=0) - np.roll(noise, 1, axis=0)) / (2e-3 * TEXEL_M)
    return np.stack([noise, right, down, noise**2], axis=-1).astype(np.float32)
