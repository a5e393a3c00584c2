"""Clouds by seed: a global pattern with storms, finer structure laid over it, and its drift."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import ndtri

from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.randomness import generator
from posse_core.sky.atmosphere import RADIUS_M
from posse_core.sky.pyramid import Pyramid

MAP_WIDTH = 2048
TILE_PX = 1024
TILE_M = 512e3
"""Side of the tile of fine structure, which repeats."""
DETAIL_SHARE = 0.22
"""Share of the field's variance that the tile holds."""
_COVER_LAT_DEG = (-90, -62, -48, -35, -20, -8, 5, 14, 25, 40, 55, 70, 90)
_COVER = (0.45, 0.72, 0.68, 0.5, 0.38, 0.42, 0.55, 0.42, 0.32, 0.46, 0.58, 0.58, 0.55)
"""Share of sky under bright cloud by latitude: the shape of MODIS' zonal means (King et al. 2013),
less their thin cirrus."""


@dataclass(frozen=True)
class Clouds:
    """A field of mean 0 and variance 1; there is cloud where it exceeds a threshold.

    Attributes:
        base: float32 map of the field's large structure, plate carrée as the ground's.
        tile: float32, 3 channels: fine structure and its slopes to the right and downwards, per
            tile pixel.
    """

    base: Pyramid
    tile: Pyramid

    def at(
        self, normal: Float32Array, latitude_rad: Float32Array, footprint_m: Float32Array, t_s: float
    ) -> tuple[Float32Array, Float32Array, Float32Array]:
        """What the sky over places holds.

        normal: (3, n) unit, ECEF axes, and latitude_rad: (n,) of the places; footprint_m: (n,) width
        that a pixel covers there. Returns, (n,), (n,) and (3, n): how far the field is above the
        threshold of cloud; the standard deviation of what the footprint averages out; the field's
        fine slope, ECEF axes, per tile pixel.
        """
        turn = -drift_rad_s(latitude_rad) * np.float32(t_s)
        cosine, sine = np.cos(turn), np.sin(turn)
        x, y, z = normal[0] * cosine - normal[1] * sine, normal[0] * sine + normal[1] * cosine, normal[2]
        level = np.log2(footprint_m / np.float32(2 * np.pi * RADIUS_M / MAP_WIDTH))
        field = self.base.between(
            np.arctan2(y, x) * np.float32(0.5 / np.pi) + np.float32(0.5),
            np.float32(0.5) - latitude_rad * np.float32(1 / np.pi),
            level,
        )
        field -= threshold(latitude_rad)
        slope = np.zeros_like(normal)
        fine_level = np.log2(footprint_m / np.float32(TILE_M / TILE_PX))
        scale = np.float32(RADIUS_M / TILE_M)
        weights = np.stack([x, y, z]) ** 4
        weights /= weights.sum(axis=0)
        # The tile is laid on from three sides, blended by how squarely each meets the ground.
        for side, (right, down) in enumerate(((y, z), (z, x), (x, y))):
            u, v = right * scale, down * scale
            sample = self.tile.at(u - np.floor(u), v - np.floor(v), fine_level)
            field += weights[side] * sample[:, 0]
            slope[(side + 1) % 3] += weights[side] * sample[:, 1]
            slope[(side + 2) % 3] += weights[side] * sample[:, 2]
        # Each halving of the tile takes away a part of its variance, and so it is with the base.
        lost = DETAIL_SHARE * np.clip(fine_level / 6, 0, 1) + (1 - DETAIL_SHARE) * np.clip(
            level / 8, 0, 1
        )
        return field, np.sqrt(lost), slope


def threshold(latitude_rad: Float32Array) -> Float32Array:
    """(...) latitudes → (...) value of the field above which there is cloud."""
    grid = np.deg2rad(np.linspace(-90, 90, 181))
    values = -ndtri(np.interp(np.rad2deg(grid), _COVER_LAT_DEG, _COVER))
    return np.asarray(np.interp(latitude_rad, grid, values), dtype=np.float32)


def drift_rad_s(latitude_rad: Float32Array) -> Float32Array:
    """(...) → eastward angular rate of the clouds over ground: trades and westerlies, ±8 m/s."""
    return np.asarray(-np.cos(3.5 * latitude_rad) * np.float32(8.0 / 6.378e6))


@functools.lru_cache(maxsize=2)
def make_clouds(seed: int) -> Clouds:
    """The clouds of a seed. Takes about a second."""
    random = generator(seed, -1, "clouds")
    return Clouds(Pyramid(_base(random)), Pyramid(_tile(random), tiles=True))


def _base(random: np.random.Generator) -> Float32Array:
    """(MAP_WIDTH / 2, MAP_WIDTH) field of variance 1 − DETAIL_SHARE."""
    places = _warped(random)
    total: Float32Array = np.zeros((32, 64), dtype=np.float32)
    volume = _noise_volume(random)
    cycles, amplitude, width = 1.6, 0.8, 128
    while width <= MAP_WIDTH:
        at = _enlarged(places, width) * np.float32(8 * cycles)
        octave = map_coordinates(
            volume, np.moveaxis(at + random.uniform(0, 64, 3), -1, 0), order=1, mode="grid-wrap"
        )
        total = _enlarged(total, width) + np.float32(amplitude) * octave
        cycles, amplitude, width = cycles * 2, amplitude * 0.75, width * 2
    # Rows near the poles stand for little area.
    area = np.cos(np.linspace(-np.pi / 2, np.pi / 2, len(total)))[:, None]
    mean = np.average(total, weights=np.broadcast_to(area, total.shape))
    variance = np.average((total - mean) ** 2, weights=np.broadcast_to(area, total.shape))
    return np.asarray((total - mean) * np.sqrt((1 - DETAIL_SHARE) / variance), dtype=np.float32)


def _enlarged(image: Float32Array, width: int) -> Float32Array:
    """A plate carrée map (h, w[, c]) made ``width`` wide, without a seam where it meets itself."""
    scale = width // image.shape[1]
    if scale == 1:
        return image
    if scale == 0:
        return np.asarray(cv2.resize(image, (width, width // 2), interpolation=cv2.INTER_AREA))
    wide = cv2.copyMakeBorder(image, 0, 0, 2, 2, cv2.BORDER_WRAP)
    size = (wide.shape[1] * scale, wide.shape[0] * scale)
    return np.asarray(cv2.resize(wide, size, interpolation=cv2.INTER_CUBIC)[:, 2 * scale : -2 * scale])


def _warped(random: np.random.Generator) -> Float32Array:
    """(256, 512, 3) unit vectors, ECEF axes, moved as winds would have moved the air."""
    y, x = np.mgrid[:256, :512]
    lat, lon = np.pi * (0.5 - (y + 0.5) / 256), 2 * np.pi * ((x + 0.5) / 512 - 0.5)
    p = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    for _ in range(36):
        # A storm: the air around its middle is wound up, inwards counter-clockwise in the north.
        sign = random.choice([-1.0, 1.0])
        centre_lat = sign * np.deg2rad(random.normal(50, 9))
        centre_lon = random.uniform(-np.pi, np.pi)
        c = np.array(
            [
                np.cos(centre_lat) * np.cos(centre_lon),
                np.cos(centre_lat) * np.sin(centre_lon),
                np.sin(centre_lat),
            ]
        )
        size = random.uniform(0.07, 0.17)
        cosine = p @ c
        angle = sign * random.uniform(1.2, 3.2) * np.exp(-2 * (1 - cosine) / size**2)
        angle = angle[..., None]
        p = (
            p * np.cos(angle)
            + np.cross(c, p) * np.sin(angle)
            + c * (cosine[..., None] * (1 - np.cos(angle)))
        )
    volume = _noise_volume(random)
    for frequency, strength in ((6.0, 0.07), (14.0, 0.03)):
        shift = [
            map_coordinates(
                volume,
                np.moveaxis(p * frequency + random.uniform(0, 64, 3), -1, 0),
                order=1,
                mode="grid-wrap",
            )
            for _ in range(3)
        ]
        p = p + strength * np.stack(shift, axis=-1)
    p[..., 2] *= 1.5  # weather is drawn out along the parallels
    return np.asarray(p, dtype=np.float32)


def _noise_volume(random: np.random.Generator) -> Float32Array:
    """(64, 64, 64) periodic noise of unit variance, with waves of 5 to 11 voxels only."""
    k = np.fft.fftfreq(64) * 64
    norm = np.sqrt(k[:, None, None] ** 2 + k[None, :, None] ** 2 + k[None, None, :33] ** 2)
    spectrum = np.fft.rfftn(random.standard_normal((64, 64, 64)))
    volume = np.fft.irfftn(
        np.where((norm >= 6) & (norm <= 13), spectrum, 0), s=(64, 64, 64), axes=(0, 1, 2)
    )
    return np.asarray(volume / volume.std(), dtype=np.float32)


def _tile(random: np.random.Generator) -> Float32Array:
    """(TILE_PX, TILE_PX, 3) field of variance DETAIL_SHARE, and its two slopes."""
    k = np.fft.fftfreq(TILE_PX) * TILE_PX
    norm = np.hypot(k[:, None], k[None, : TILE_PX // 2 + 1])
    norm[0, 0] = 1
    fall = np.where(norm >= 8, norm**-1.75, 0)  # waves of 64 km and less
    fields: list[FloatArray] = [
        np.fft.irfft2(
            fall * np.fft.rfft2(random.standard_normal((TILE_PX, TILE_PX))), s=(TILE_PX, TILE_PX)
        )
        for _ in range(2)
    ]
    puffs = np.hypot(fields[0], fields[1])  # round tops between sharp clefts
    puffs = (puffs - puffs.mean()) * np.sqrt(DETAIL_SHARE) / puffs.std()
    right = (np.roll(puffs, -1, axis=1) - np.roll(puffs, 1, axis=1)) / 2
    down = (np.roll(puffs, -1, axis=0) - np.roll(puffs, 1, axis=0)) / 2
    return np.asarray(np.stack([puffs, right, down], axis=-1), dtype=np.float32)
