"""The atmosphere: single scattering by air (Rayleigh) and haze, and absorption by ozone, in a spherical
shell.

The Earth's ellipsoid is mapped to a sphere by stretching the polar axis (0.3 %), so heights here are
heights above the ellipsoid.
"""

from __future__ import annotations

import functools
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

_HEIGHTS = 64
_SUNS = 128


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
    return padded(np.exp(-columns @ EXTINCTION))


def padded(light: RealArray) -> Float32Array:
    """(..., 3) → (..., 4) float32 with an empty last channel."""
    wider = np.zeros((*light.shape[:-1], 4), dtype=np.float32)
    wider[..., :3] = light
    return wider


def sunlight(height_m: RealArray, mu: RealArray) -> Float32Array:
    """Heights and cosines of the Sun's zenith angle, of shapes that broadcast to (...) → (..., 3)
    transmission of sunlight to there."""
    height: FloatArray = np.asarray(np.clip(height_m, 0, TOP_M), dtype=np.float64)
    above = ((mu - horizon_cosine(height)) / (1 - horizon_cosine(height))).astype(np.float32)
    return transmitted(height, above)[..., :3]


def horizon_cosine(height_m: FloatArray) -> FloatArray:
    """(...) heights → (...) cosine of the horizon's zenith angle."""
    return np.asarray(-np.sqrt(np.maximum(0, 1 - (RADIUS_M / (RADIUS_M + height_m)) ** 2)))


def transmitted(height_m: FloatArray, above: Float32Array) -> Float32Array:
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
    return padded(direct + diffuse[None])
