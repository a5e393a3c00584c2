"""The atmosphere: single scattering by air (Rayleigh) and haze, and absorption by ozone, in a spherical
shell.

The Earth's ellipsoid is mapped to a sphere by stretching the polar axis (0.3 %), so heights here are
heights above the ellipsoid.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._constants import Constants
from posse_core._model.bands import BAND_CENTRES_M
from posse_core._sky.pyramid import lookup

RealArray: TypeAlias = Float32Array | FloatArray
RADIUS_M = Constants().earth_radius_m
TOP_M = 90e3
"""Height of the top of the atmosphere."""

_LAMBDA_UM = np.array(BAND_CENTRES_M) * 1e6
RAYLEIGH_DEPTH: FloatArray = (
    0.008569 * _LAMBDA_UM**-4 * (1 + 0.0113 * _LAMBDA_UM**-2 + 0.00013 * _LAMBDA_UM**-4)
)
"""(3,) vertical optical depth of clean air (Hansen & Travis 1974, eq. 2.29)."""
AEROSOL_DEPTH: FloatArray = 0.08 * (_LAMBDA_UM / 0.55) ** -1.3
"""(3,) vertical optical depth of haze on a clear day, with Ångström exponent 1.3."""
AEROSOL_ALBEDO = 0.95
"""Single-scattering albedo of haze."""
AEROSOL_ASYMMETRY = 0.7
"""g of the Henyey–Greenstein phase function of haze."""
OZONE_DEPTH: FloatArray = np.array([0.026, 0.024, 0.002])
"""(3,) vertical optical depth of 300 Dobson units of ozone (Chappuis band), averaged over each band."""

_STEPS = 24
_HEIGHTS = 64
_SUNS = 128
GROUND_ROWS = 64
LIMB_ROWS = 64
AZIMUTHS = 72


def densities(height_m: RealArray) -> FloatArray:
    """(...) heights → (..., 3) densities of air, haze and ozone, per metre; each integrates to 1 over a
    vertical column.

    Air and haze have scale heights of 8.0 and 1.5 km; ozone has a triangular profile from 7 to 37 km.
    """
    air = np.exp(-height_m / 8000.0) / 8000.0
    haze = np.exp(-height_m / 1500.0) / 1500.0
    ozone = np.maximum(0.0, 1 - np.abs(height_m - 22e3) / 15e3) / 15e3
    return np.stack([air, haze, ozone], axis=-1)


EXTINCTION: FloatArray = np.stack([RAYLEIGH_DEPTH, AEROSOL_DEPTH, OZONE_DEPTH])
"""(3, 3) optical depth of a vertical column, species × band."""
_FORWARD = np.array([0.5, 0.5 * (1 + AEROSOL_ASYMMETRY), 0.0])
_ALBEDO = np.array([1.0, AEROSOL_ALBEDO, 0.0])
DIMMING: FloatArray = EXTINCTION * (1 - _ALBEDO * _FORWARD)[:, None]
"""(3, 3) effective optical depth for light from extended ground, species × band. Light that is scattered
forward is not lost: as much comes in from the surroundings."""


@functools.cache
def _sun_table() -> Float32Array:
    """(_HEIGHTS, _SUNS, 4) transmission of sunlight, by height and by the Sun's zenith angle; the last
    channel is empty, because OpenCV takes samples of four in half the time.

    Row i is the height TOP_M (i/n)². Column j is the cosine of the zenith angle
    μ = μ_horizon + (1 − μ_horizon) (j/n)².
    """
    height_m = TOP_M * np.linspace(0, 1, _HEIGHTS) ** 2
    r = RADIUS_M + height_m[:, None]
    horizon = -np.sqrt(np.maximum(0, 1 - (RADIUS_M / r) ** 2))
    mu = horizon + (1 - horizon) * np.linspace(0, 1, _SUNS) ** 2
    b2 = r**2 * (1 - mu**2)
    # Steps are uniform in the square root of the path length, because the air is densest at its start.
    way_m = -r * mu + np.sqrt(np.maximum(0, (RADIUS_M + TOP_M) ** 2 - b2))
    edges = np.linspace(0, 1, 65) ** 2
    middle = (edges[1:] + edges[:-1]) / 2
    along_m = way_m[..., None] * middle
    heights = np.sqrt(r[..., None] ** 2 + along_m**2 + 2 * (r * mu)[..., None] * along_m) - RADIUS_M
    columns = np.einsum(
        "hsnk,hsn->hsk", densities(np.maximum(0, heights)), way_m[..., None] * np.diff(edges)
    )
    return _padded(np.exp(-columns @ EXTINCTION))


def _padded(light: RealArray) -> Float32Array:
    """(..., 3) → (..., 4) float32 with an empty last channel."""
    padded = np.zeros((*light.shape[:-1], 4), dtype=np.float32)
    padded[..., :3] = light
    return padded


def sunlight(height_m: RealArray, mu: RealArray) -> Float32Array:
    """Heights and cosines of the Sun's zenith angle, of shapes that broadcast to (...) → (..., 3)
    transmission of sunlight to there."""
    height: FloatArray = np.asarray(np.clip(height_m, 0, TOP_M), dtype=np.float64)
    above = ((mu - _horizon(height)) / (1 - _horizon(height))).astype(np.float32)
    return _transmitted(height, above)[..., :3]


def _horizon(height_m: FloatArray) -> FloatArray:
    """(...) heights → (...) cosine of the horizon's zenith angle."""
    return np.asarray(-np.sqrt(np.maximum(0, 1 - (RADIUS_M / (RADIUS_M + height_m)) ** 2)))


def _transmitted(height_m: FloatArray, above: Float32Array) -> Float32Array:
    """Transmission of sunlight, (..., 4) with an empty last channel, at heights that broadcast to (...),
    where the Sun's cosine is the share ``above`` (...) of the way from the horizon's to 1."""
    row = (np.sqrt(height_m / TOP_M) * (_HEIGHTS - 1)).astype(np.float32)
    column = np.sqrt(np.maximum(above, 0))
    column *= np.float32(_SUNS - 1)
    share = lookup(_sun_table(), column, np.ascontiguousarray(np.broadcast_to(row, column.shape)))
    share[above < 0] = 0
    return np.asarray(share)


GROUND_SUNS = 1024
GROUND_MU_MIN = -0.3


@functools.cache
def ground_irradiance() -> Float32Array:
    """(1, GROUND_SUNS, 4) irradiance of level ground per solar irradiance above the atmosphere.

    Column j is the cosine of the Sun's zenith angle, from GROUND_MU_MIN to 1. The irradiance is direct
    sunlight plus half of the light that the column above scatters once, which also gives twilight when
    the Sun is below the horizon. The last channel is empty.
    """
    mu = np.linspace(GROUND_MU_MIN, 1, GROUND_SUNS)[None]
    direct = np.maximum(0, mu)[..., None] * sunlight(np.zeros_like(mu), mu)
    edges_m = TOP_M * np.linspace(0, 1, 65) ** 2
    height_m = (edges_m[1:, None] + edges_m[:-1, None]) / 2
    lit = sunlight(height_m, mu)
    scattering = densities(height_m[:, 0])[:, :2] @ np.stack(
        [RAYLEIGH_DEPTH, AEROSOL_ALBEDO * AEROSOL_DEPTH]
    )
    diffuse = 0.5 * np.einsum("hsb,hb,h->sb", lit, scattering, np.diff(edges_m))
    return _padded(direct + diffuse[None])


@dataclass(frozen=True)
class AirTables:
    """Scattered light and transmission along all rays from one position.

    Rows 0 … GROUND_ROWS−1 are rays that hit the ground, where the cosine of their zenith angle is
    i/(GROUND_ROWS−1). They are followed by LIMB_ROWS rows of rays that pass the ground at the height
    TOP_M (i/(LIMB_ROWS−1))². Columns are azimuths relative to the Sun's, 0 … π.

    Attributes:
        light: (rows, AZIMUTHS, 4) scattered radiance per solar irradiance, sr⁻¹; the last channel is
            empty.
        passed: (rows, 1, 4) transmission of light from the ground, or from beyond the limb, likewise.
    """

    light: Float32Array
    passed: Float32Array

    def glow(self, row: Float32Array, azimuth_rad: Float32Array) -> Float32Array:
        """(n,) row positions and azimuths → (n, 3) scattered radiance."""
        column = azimuth_rad * np.float32((AZIMUTHS - 1) / np.pi)
        return np.asarray(lookup(self.light, column, row)[:, :3])

    def transmission(self, row: Float32Array) -> Float32Array:
        """(n,) row positions → (n, 3) transmission."""
        return np.asarray(lookup(self.passed, np.zeros_like(row), row)[:, :3])


def limb_row(height_m: FloatArray) -> Float32Array:
    """Table rows of rays that pass the ground at a height: (...) → (...)."""
    share = np.sqrt(np.clip(height_m, 0, TOP_M) / TOP_M)
    return (GROUND_ROWS + share * (LIMB_ROWS - 1)).astype(np.float32)


def ground_row(mu: FloatArray) -> Float32Array:
    """Table rows of rays that hit the ground at a cosine of their zenith angle: (...) → (...)."""
    return (mu * (GROUND_ROWS - 1)).astype(np.float32)


@functools.lru_cache(maxsize=1)  # a frame's background and its environment map share one
def air_tables(distance_m: float, sun_zenith_cosine: float) -> AirTables:
    """Trace all rays from a position at ``distance_m`` from the Earth's centre."""
    distance_m = max(distance_m, RADIUS_M + TOP_M)
    azimuth = np.linspace(0, np.pi, AZIMUTHS)
    mu = np.linspace(0, 1, GROUND_ROWS)
    passing_m = TOP_M * np.linspace(0, 1, LIMB_ROWS) ** 2
    squares = (np.linspace(1, 0, _STEPS + 1)) ** 2  # from the top down
    b_ground = RADIUS_M * np.sqrt(1 - mu**2)
    to_ground = _way_m(b_ground, np.zeros_like(mu), squares)
    b_limb = RADIUS_M + passing_m
    near = _way_m(b_limb, passing_m, squares)
    through = np.concatenate([near, -near[:, -2::-1]], axis=1)
    parts = [
        _trace(b, way, behind, distance_m, sun_zenith_cosine, azimuth)
        for b, way, behind in ((b_ground, to_ground, DIMMING), (b_limb, through, EXTINCTION))
    ]
    return AirTables(*(_padded(np.concatenate(part)) for part in zip(*parts, strict=True)))


def _way_m(b_m: FloatArray, lowest_m: FloatArray, squares: FloatArray) -> FloatArray:
    """(rays, steps + 1) distances along each ray, counted backwards from its point nearest to the
    Earth's centre."""
    height_m = lowest_m[:, None] + (TOP_M - lowest_m[:, None]) * squares
    return np.asarray(np.sqrt(np.maximum(0, (RADIUS_M + height_m) ** 2 - b_m[:, None] ** 2)))


def _trace(
    b_m: FloatArray,
    way_m: FloatArray,
    behind: FloatArray,
    distance_m: float,
    sun_zenith_cosine: float,
    azimuth_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Integrate along rays.

    Args:
        b_m: (rays,) impact parameters, the rays' least distances from the Earth's centre.
        way_m: (rays, steps + 1) borders of the steps, as of :func:`_way_m`.
        behind: (3, 3) optical depths for light from the end of the ray, species × band.
        distance_m: distance of the rays' origin from the Earth's centre.
        sun_zenith_cosine: cosine of the Sun's zenith angle at the origin.
        azimuth_rad: (azimuths,) azimuths of the rays relative to the Sun's.

    Returns:
        (rays, azimuths, 3) glow and (rays, 1, 3) transmission.
    """
    step_m = -np.diff(way_m)
    middle_m = (way_m[:, 1:] + way_m[:, :-1]) / 2
    radius_m = np.hypot(middle_m, b_m[:, None])
    column = densities(np.maximum(0, radius_m - RADIUS_M)) * step_m[..., None]
    depth = column @ EXTINCTION
    passed = np.exp(-(np.cumsum(depth, axis=1) - depth / 2))
    scattered = passed[:, :, None, :] * np.stack(
        [column[..., :1] * RAYLEIGH_DEPTH, column[..., 1:2] * AEROSOL_ALBEDO * AEROSOL_DEPTH], axis=2
    )
    # The ray's direction in the plane of zenith and Sun is (−cos η, sin η cos φ).
    sine = np.minimum(1, b_m / distance_m)
    cosine = np.sqrt(1 - sine**2)
    sun_horizontal = np.sqrt(max(0.0, 1 - sun_zenith_cosine**2))
    forward = -cosine[:, None] * sun_zenith_cosine + sine[:, None] * np.cos(azimuth_rad) * sun_horizontal
    # The Sun's cosine at a step is a + b forward, of which the share above the horizon is taken.
    along_m = (distance_m * cosine)[:, None] - middle_m
    height_m = np.clip(radius_m - RADIUS_M, 0, TOP_M)
    horizon = _horizon(height_m)
    a = ((distance_m * sun_zenith_cosine / radius_m - horizon) / (1 - horizon)).astype(np.float32)
    b = (along_m / (radius_m * (1 - horizon))).astype(np.float32)
    above = a[:, :, None] + b[:, :, None] * forward.astype(np.float32)[:, None, :]
    rays, steps, azimuths = above.shape
    lit = _transmitted(height_m.reshape(-1, 1), above.reshape(-1, azimuths))
    # (rays, species and bands, steps) @ (rays, steps, azimuths and bands), of which equal bands count.
    by_species = scattered.astype(np.float32).reshape(rays, steps, 6).transpose(0, 2, 1) @ lit.reshape(
        rays, steps, azimuths * 4
    )
    of_air, of_haze = np.einsum("rsbab->srab", by_species.reshape(rays, 2, 3, azimuths, 4)[..., :3])
    rayleigh = 3 / (16 * np.pi) * (1 + forward**2)
    g = AEROSOL_ASYMMETRY
    haze = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * forward) ** 1.5)
    glow = of_air * rayleigh[..., None] + of_haze * haze[..., None]
    return glow, np.exp(-column.sum(axis=1) @ behind)[:, None, :]
