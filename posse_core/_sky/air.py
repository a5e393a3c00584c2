"""The air that a camera above it sees: its scattered light, and what it lets pass, by tables.

A ray is known by how it passes the Earth, and the light that it collects by two more numbers: where
the Sun is above its foot, and the angle between ray and Sun. So the light is computed once, for all
positions of the camera and the Sun, and a frame's tables are taken from it.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import Float32Array, FloatArray
from posse_core._files.cache import cached_array
from posse_core._sky import atmosphere
from posse_core._sky.atmosphere import (
    AEROSOL_ALBEDO,
    AEROSOL_ASYMMETRY,
    AEROSOL_DEPTH,
    DIMMING,
    EXTINCTION,
    RADIUS_M,
    RAYLEIGH_DEPTH,
    TOP_M,
    densities,
    horizon_cosine,
    padded,
    transmitted,
)
from posse_core._sky.pyramid import lookup

_STEPS = 36
GROUND_ROWS = 64
LIMB_ROWS = 64
AZIMUTHS = 144
_SUNS, _SUN_CURVE = 97, 3.0
"""Heights of the Sun above the foot of a ray for which light is computed, and how much closer to each
other they are at the horizon."""
_ANGLES = 17
"""Cosines of the angle between ray and Sun, likewise."""
_VERSIONS = repr((np.__version__, cv2.__version__)).encode()


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
        """(...) row positions and azimuths → (..., 3) scattered radiance."""
        column = azimuth_rad * np.float32((AZIMUTHS - 1) / np.pi)
        return np.asarray(lookup(self.light, column, row)[..., :3])

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
    """The tables for a position at ``distance_m`` from the Earth's centre, where the Sun's zenith angle
    has the given cosine."""
    distance_m = max(distance_m, RADIUS_M + TOP_M)
    rays = _rays()
    # The ray's direction in the plane of zenith and Sun is (−cos η, sin η cos φ).
    sine = np.minimum(1, rays.nearest_m / distance_m)[:, None]
    cosine = np.sqrt(1 - sine**2)
    sun_horizontal = np.sqrt(max(0.0, 1 - sun_zenith_cosine**2))
    azimuth = np.linspace(0, np.pi, AZIMUTHS)
    forward = -cosine * sun_zenith_cosine + sine * np.cos(azimuth) * sun_horizontal
    way_m = distance_m * cosine - rays.foot_m[:, None]
    sun = (distance_m * sun_zenith_cosine + way_m * forward) / rays.foot_radius_m[:, None]
    below = (_SUNS / 2 - 0.5) * (1 + _curved(np.clip(sun, -1, 1)))
    row = (np.arange(len(sun))[:, None] * _SUNS + below).astype(np.float32)
    column = ((_ANGLES - 1) / 2 * (1 + forward)).astype(np.float32)
    of_air, of_haze = (lookup(light, column, row) for light in _light())
    phase_of_air = 3 / (16 * np.pi) * (1 + forward**2)
    g = AEROSOL_ASYMMETRY
    phase_of_haze = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * forward) ** 1.5)
    of_air *= phase_of_air.astype(np.float32)[..., None]
    of_haze *= phase_of_haze.astype(np.float32)[..., None]
    return AirTables(of_air + of_haze, _passed())


@dataclass(frozen=True)
class _Rays:
    """The rays of the tables' rows, in steps from the camera's side to the other.

    Distances along a ray are counted backwards, from its point nearest to the Earth's centre.

    Attributes:
        nearest_m: (rows,) distance of that point from the Earth's centre.
        foot_m: (rows,) where the ray meets the ground; 0 for those that pass it, whose foot is that
            point.
        foot_radius_m: (rows,) distance of the foot from the Earth's centre.
        middle_m: (rows, steps) middles of the steps. Rays that hit the ground have as many steps as the
            others, of which the last have no length.
        step_m: (rows, steps) their lengths.
    """

    nearest_m: FloatArray
    foot_m: FloatArray
    foot_radius_m: FloatArray
    middle_m: FloatArray
    step_m: FloatArray

    @property
    def radius_m(self) -> FloatArray:
        """(rows, steps) distances of the steps from the Earth's centre."""
        return np.asarray(np.hypot(self.middle_m, self.nearest_m[:, None]))

    @property
    def columns(self) -> FloatArray:
        """(rows, steps, 3) share of a vertical column of air, haze and ozone in each step."""
        return densities(np.maximum(0, self.radius_m - RADIUS_M)) * self.step_m[..., None]


@functools.cache
def _rays() -> _Rays:
    mu = np.linspace(0, 1, GROUND_ROWS)
    passing_m = TOP_M * np.linspace(0, 1, LIMB_ROWS) ** 2
    lowest_m = np.concatenate([np.zeros_like(mu), passing_m])
    nearest_m = np.concatenate([RADIUS_M * np.sqrt(1 - mu**2), RADIUS_M + passing_m])
    squares = np.linspace(1, 0, _STEPS + 1) ** 2  # from the top down
    height_m = lowest_m[:, None] + (TOP_M - lowest_m[:, None]) * squares
    down_m = np.sqrt(np.maximum(0, (RADIUS_M + height_m) ** 2 - nearest_m[:, None] ** 2))
    foot_m = np.where(np.arange(len(nearest_m)) < GROUND_ROWS, down_m[:, -1], 0.0)
    up_m = np.where(foot_m[:, None] > 0, foot_m[:, None], -down_m[:, -2::-1])
    # The ray along the horizon hits the ground where it is nearest, and ends there as well.
    up_m[0] = 0.0
    borders_m = np.concatenate([down_m, up_m], axis=1)
    return _Rays(
        nearest_m,
        foot_m,
        np.hypot(nearest_m, foot_m),
        (borders_m[:, 1:] + borders_m[:, :-1]) / 2,
        -np.diff(borders_m),
    )


@functools.cache
def _passed() -> Float32Array:
    """(rows, 1, 4) as :class:`AirTables` has it."""
    columns = _rays().columns.sum(axis=1)
    depths = np.concatenate([columns[:GROUND_ROWS] @ DIMMING, columns[GROUND_ROWS:] @ EXTINCTION])
    return padded(np.exp(-depths)[:, None])


@functools.cache
def _light() -> Float32Array:
    """(2, rows · _SUNS, _ANGLES, 4) sunlight that reaches the air along each ray, and from there the
    camera, by air and by haze, without their phase functions.

    Below each other are the Sun's heights above each row's foot. The user's cache has it.
    """
    recipe = (*(Path(file).read_bytes() for file in (__file__, atmosphere.__file__)), _VERSIONS)
    return cached_array("air", recipe, _collected)


def _collected() -> Float32Array:
    rays = _rays()
    columns, radius_m = rays.columns, rays.radius_m
    depth = columns @ EXTINCTION
    passed = np.exp(-(np.cumsum(depth, axis=1) - depth / 2))
    scattering = np.stack(
        [columns[..., :1] * RAYLEIGH_DEPTH, columns[..., 1:2] * AEROSOL_ALBEDO * AEROSOL_DEPTH], axis=2
    )
    scattered = padded(passed[:, :, None, :] * scattering)
    height_m = np.clip(radius_m - RADIUS_M, 0, TOP_M)
    horizon = horizon_cosine(height_m)
    sun = np.sinh(_SUN_CURVE * np.linspace(-1, 1, _SUNS)) / np.sinh(_SUN_CURVE)
    forward = np.linspace(-1, 1, _ANGLES)
    light = np.empty((2, len(radius_m), _SUNS, _ANGLES, 4), dtype=np.float32)
    for row, of_step in enumerate(scattered):
        # The Sun's cosine at a step, of which the share above the horizon is taken.
        high = rays.foot_radius_m[row] * sun / radius_m[row][:, None]
        along = (rays.foot_m[row] - rays.middle_m[row]) / radius_m[row]
        cosine = high[:, :, None] + along[:, None, None] * forward
        above = (cosine - horizon[row][:, None, None]) / (1 - horizon[row][:, None, None])
        steps = len(above)
        lit = transmitted(height_m[row][:, None], above.reshape(steps, -1).astype(np.float32))
        light[:, row] = np.einsum("tsb,tmb->smb", of_step, lit).reshape(2, _SUNS, _ANGLES, 4)
    return light.reshape(2, -1, _ANGLES, 4)


def _curved(cosine: FloatArray) -> FloatArray:
    """Cosines of the Sun's zenith angle, −1 … 1 → where they are among those of the table, likewise."""
    return np.asarray(np.arcsinh(np.sinh(_SUN_CURVE) * cosine) / _SUN_CURVE)
