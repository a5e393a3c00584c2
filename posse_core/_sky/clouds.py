"""Random clouds: a global pattern with storms, fine structure on top of it, and drift with the wind."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import scipy
from scipy.ndimage import map_coordinates
from scipy.special import ndtri

from posse_core import _frames, _randomness
from posse_core._arrays import Float32Array
from posse_core._files.cache import cached_array
from posse_core._frames import rotated
from posse_core._randomness import random_generator
from posse_core._sky import pyramid as pyramids
from posse_core._sky.atmosphere import RADIUS_M
from posse_core._sky.detail import Detail, make_detail
from posse_core._sky.pyramid import Pyramid, lookup

MAP_WIDTH = 2048
DETAIL_SHARE = 0.2
"""Share of the field's variance that the fine structure has."""
_COVER_LAT_DEG = (-90, -62, -48, -35, -20, -8, 5, 14, 25, 40, 55, 70, 90)
_COVER = (0.50, 0.86, 0.82, 0.62, 0.50, 0.52, 0.68, 0.55, 0.44, 0.60, 0.72, 0.70, 0.62)
"""Cloud cover at these latitudes, after MODIS' zonal means (King et al. 2013)."""
_THRESHOLD_STEPS = 180
_DEPTHS = (-5.0, 6.0, 276)
_VARIANCES = (1.5, 31)
"""First and last value and number of the columns, and last value and number of the rows of
:func:`_mean_table`."""
_STORM_REACH = 14.0
"""How far from its centre a storm is computed; there it turns the air by less than 3 µrad."""


@dataclass(frozen=True)
class Clouds:
    """A random field of mean 0 and variance 1. There is cloud where it exceeds a threshold.

    What a pixel sees is the mean of the light within it, which is not the light of the mean field. So
    the maps have the mean and the mean square of the field, as LEAN mapping has of slopes (Olano & Baker
    2010, I3D), and the light is averaged over a normal distribution with their variance.

    Attributes:
        base: float32 map with 3 channels, plate carrée as the ground's map: the field's large structure,
            its square, and the standard deviation of the fine structure, since how broken the clouds are
            varies over the globe.
        detail: fine structure that is added to the large one.
    """

    base: Pyramid
    detail: Detail

    def at(
        self,
        drifted: Float32Array,
        longitude: Float32Array,
        latitude: Float32Array,
        log_footprint: Float32Array,
    ) -> tuple[Float32Array, Float32Array, list[Float32Array]]:
        """Sample the field above points on the ground.

        Args:
            drifted: (3, ...) unit normals of the ground as by :func:`drifted`.
            longitude, latitude: (...) positions of those on the map, as of ``Surface``.
            log_footprint: (...) binary logarithm of the width in metres that a pixel covers there.

        Returns:
            (...) mean and (...) variance of the field within the footprint; the mean slope of the fine
            structure along the three ECEF axes, per kilometre, as of :meth:`Detail.at`.
        """
        level = log_footprint + np.float32(np.log2(MAP_WIDTH / (2 * np.pi * RADIUS_M)))
        x = longitude - np.floor(longitude)
        field, square, strength = self.base.between(x, latitude, level)
        variance = square - field * field
        fine, fine_variance, slope = self.detail.at(drifted, log_footprint)
        fine *= strength
        field += fine
        slope = [along * strength for along in slope]
        strength *= strength
        fine_variance *= strength
        variance += fine_variance
        return field, variance, slope


def cover_and_light(depth: Float32Array, variance: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Share of a footprint that clouds cover, and the reflectance that they add to it.

    Args:
        depth: (...) mean of the field above its threshold.
        variance: (...) its variance within the footprint.

    Returns:
        (...) cover, and (...) cover times the clouds' reflectance, both averaged over the footprint.
    """
    first, last, columns = _DEPTHS
    most, rows = _VARIANCES
    column = (depth - np.float32(first)) * np.float32((columns - 1) / (last - first))
    row = variance * np.float32((rows - 1) / most)
    found = lookup(_mean_table(), column, row)
    return found[..., 0], found[..., 1]


@functools.cache
def _mean_table() -> Float32Array:
    """(variances, depths, 4) cover and cover times reflectance, averaged over normal distributions; the
    last two channels are empty, because OpenCV takes samples of four in half the time.

    Thin clouds reflect 0.2 and thick ones 0.9, with which the planet reflects as much as is measured
    (docs/sky.md).
    """
    depth = np.linspace(*_DEPTHS)
    sigma = np.sqrt(np.linspace(0, *_VARIANCES))
    z = np.linspace(-5, 5, 401)
    weight = np.exp(-z * z / 2)
    values = depth[:, None] + sigma[:, None, None] * z
    cover = np.clip(values / 1.1 + 0.35, 0, 1)
    cover *= cover * (3 - 2 * cover)
    bright = 0.9 - 0.7 * np.exp(-0.8 * np.maximum(values, 0))
    table = np.zeros((len(sigma), len(depth), 4), dtype=np.float32)
    table[..., 0] = cover @ weight / weight.sum()
    table[..., 1] = (cover * bright) @ weight / weight.sum()
    return table


def drifted(normal: Float32Array, latitude_rad: Float32Array, t_s: float) -> Float32Array:
    """(3, ...) unit normals of the ground, ECEF axes, and (...) latitudes → (3, ...) normals where the
    clouds that are above them at ``t_s`` after the epoch were at the epoch."""
    turn = -drift_rad_s(latitude_rad) * np.float32(t_s)
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack(
        [normal[0] * cosine - normal[1] * sine, normal[0] * sine + normal[1] * cosine, normal[2]]
    )


def threshold(latitude_rad: Float32Array) -> Float32Array:
    """(...) latitudes → (...) values of the field above which there is cloud."""
    column = (latitude_rad + np.float32(np.pi / 2)) * np.float32(_THRESHOLD_STEPS / np.pi)
    return np.asarray(lookup(_threshold_table(), column, np.zeros_like(column)))


@functools.cache
def _threshold_table() -> Float32Array:
    """(1, _THRESHOLD_STEPS + 1) thresholds at latitudes from −90° to 90°."""
    latitude_deg = np.linspace(-90, 90, _THRESHOLD_STEPS + 1)
    return np.asarray(-ndtri(np.interp(latitude_deg, _COVER_LAT_DEG, _COVER)), dtype=np.float32)[None]


def drift_rad_s(latitude_rad: Float32Array) -> Float32Array:
    """(...) latitudes → (...) eastward angular rates of the clouds over the ground: trade winds and
    westerlies, ±8 m/s."""
    return np.asarray(-np.cos(3.5 * latitude_rad) * np.float32(8.0 / 6.378e6))


@functools.lru_cache(maxsize=2)
def make_clouds(seed: int) -> Clouds:
    """The clouds for a seed. Those of the last seed are in the user's cache."""
    versions = (np.__version__, scipy.__version__, cv2.__version__)
    files = (__file__, _frames.__file__, _randomness.__file__, pyramids.__file__)
    recipe = (*(Path(file).read_bytes() for file in files), repr((seed, versions)).encode())
    sheet = cached_array("clouds", recipe, lambda: Pyramid(_map(seed)).sheet)
    return Clouds(Pyramid.kept(sheet, (MAP_WIDTH // 2, MAP_WIDTH, 3)), make_detail(seed))


def _map(seed: int) -> Float32Array:
    """(MAP_WIDTH / 2, MAP_WIDTH, 3) map as :class:`Clouds` has it."""
    base = _base(random_generator(seed, -1, "clouds"))
    # Where the fine structure is strong is decided by another part of the map, without its own details.
    broken = np.clip(0.9 + 0.5 * np.roll(_enlarged(base, 256), 97, axis=1), 0.25, 1.7)
    strength = np.float32(np.sqrt(DETAIL_SHARE)) * _enlarged(broken, MAP_WIDTH)
    return np.dstack([base, base * base, strength])


def _base(random: np.random.Generator) -> Float32Array:
    """(MAP_WIDTH / 2, MAP_WIDTH) field of mean 0 and variance 1 − DETAIL_SHARE."""
    positions = _warped(random)
    total: Float32Array = np.zeros((32, 64), dtype=np.float32)
    volume = _noise_volume(random)
    amplitude = 0.8
    for cycles, width in ((1.6, 128), (3.2, 256), (6.4, 512), (13, 1024), (26, 2048), (52, 2048)):
        at = _enlarged(positions, width) * np.float32(8 * cycles)
        octave = map_coordinates(
            volume, np.moveaxis(at + random.uniform(0, 64, 3), -1, 0), order=1, mode="grid-wrap"
        )
        total = _enlarged(total, width) + np.float32(amplitude) * octave
        amplitude *= 0.78
    # Rows near the poles represent little area.
    area = np.cos(np.linspace(-np.pi / 2, np.pi / 2, len(total)))[:, None]
    mean = np.average(total, weights=np.broadcast_to(area, total.shape))
    variance = np.average((total - mean) ** 2, weights=np.broadcast_to(area, total.shape))
    return np.asarray((total - mean) * np.sqrt((1 - DETAIL_SHARE) / variance), dtype=np.float32)


def _enlarged(image: Float32Array, width: int) -> Float32Array:
    """A plate carrée map (h, w[, c]) resized to ``width`` columns, without a seam at its left and right
    borders."""
    scale = width // image.shape[1]
    if scale == 1:
        return image
    if scale == 0:
        return np.asarray(cv2.resize(image, (width, width // 2), interpolation=cv2.INTER_AREA))
    wide = cv2.copyMakeBorder(image, 0, 0, 2, 2, cv2.BORDER_WRAP)
    size = (wide.shape[1] * scale, wide.shape[0] * scale)
    return np.asarray(cv2.resize(wide, size, interpolation=cv2.INTER_CUBIC)[:, 2 * scale : -2 * scale])


def _warped(random: np.random.Generator) -> Float32Array:
    """(256, 512, 3) directions on a plate carrée map, ECEF axes, displaced as winds displace the air."""
    y, x = np.mgrid[:256, :512]
    lat, lon = np.pi * (0.5 - (y + 0.5) / 256), 2 * np.pi * ((x + 0.5) / 512 - 0.5)
    p = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    for _ in range(36):
        # A storm winds up the air around its centre, inwards and counter-clockwise in the north.
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
        strength = sign * random.uniform(1.2, 3.2)
        apart = 2 * (1 - p @ c) / size**2
        near = apart < _STORM_REACH
        p[near] = rotated(p[near], c, strength * np.exp(-apart[near]))
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
    p[..., 2] *= 1.5  # weather is elongated along the parallels
    return np.asarray(p, dtype=np.float32)


def _noise_volume(random: np.random.Generator) -> Float32Array:
    """(64, 64, 64) periodic noise of unit variance, with wavelengths of 5 to 11 voxels only."""
    k = np.fft.fftfreq(64) * 64
    norm = np.sqrt(k[:, None, None] ** 2 + k[None, :, None] ** 2 + k[None, None, :33] ** 2)
    spectrum = np.fft.rfftn(random.standard_normal((64, 64, 64)))
    volume = np.fft.irfftn(
        np.where((norm >= 6) & (norm <= 13), spectrum, 0), s=(64, 64, 64), axes=(0, 1, 2)
    )
    return np.asarray(volume / volume.std(), dtype=np.float32)
