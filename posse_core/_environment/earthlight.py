"""The Earth as a source of light: sunlight that it reflects, and its own infrared.

Both come from the whole cap that a spacecraft sees, patch by patch. Albedo and emissivity follow the
latitude and the season (Knocke, Ries & Tapley 1988, AIAA 88-4292): zonal means, no clouds of the
day, Lambert's law. So the night side reflects nothing and radiates nearly as much as the day side.
Broadband, 0.2 to 50 µm; the Earth in images has its own model in ``posse_core._sky``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_with_z, unit

_SEASON_RAD_DAY = 2 * np.pi / 365.25
_SEASON_START_JD = 2444960.5
"""22 December 1981, from which Knocke, Ries & Tapley count the season."""
_RINGS = 8
"""Rings that the visible cap is cut into (Gauss–Legendre), each of four times as many patches.

The sum errs by less than 0.1 W/m² of up to 400, far below the model's own error.
"""
_RING_PLACE, _RING_WEIGHT = np.polynomial.legendre.leggauss(_RINGS)
_CHUNK = 512


@dataclass(frozen=True)
class EarthLight:
    """Irradiance on a plate, W/m², both (...,)."""

    albedo_w_m2: FloatArray
    infrared_w_m2: FloatArray


def albedo(sin_latitude: FloatArray, jd_tt: FloatArray) -> FloatArray:
    """Share of sunlight that the ground sends back, by latitude and season; shapes broadcast."""
    season = np.cos(_SEASON_RAD_DAY * (jd_tt - _SEASON_START_JD))
    return np.asarray(0.34 + 0.10 * season * sin_latitude + 0.29 * _legendre_2(sin_latitude))


def emissivity(sin_latitude: FloatArray, jd_tt: FloatArray) -> FloatArray:
    """Infrared exitance over a quarter of the solar flux, by latitude and season."""
    season = np.cos(_SEASON_RAD_DAY * (jd_tt - _SEASON_START_JD))
    return np.asarray(0.68 - 0.07 * season * sin_latitude - 0.18 * _legendre_2(sin_latitude))


def _legendre_2(x: FloatArray) -> FloatArray:
    return np.asarray((3 * x**2 - 1) / 2)


def earthlight_on_plate(
    *,
    r_eci_m: FloatArray,
    normal_eci: FloatArray,
    r_sun_eci_m: FloatArray,
    earth_pole_eci: FloatArray,
    jd_tt: FloatArray,
    solar_flux_w_m2: FloatArray,
    earth_radius_m: float,
) -> EarthLight:
    """Light of the Earth on a plate that sees it with one side, for F places.

    Args:
        r_eci_m, normal_eci, r_sun_eci_m, earth_pole_eci: (F, 3) in any axes from the Earth's centre;
            the plate's normal and the pole of any length.
        jd_tt: (F,) for the season.
        solar_flux_w_m2: (F,) at the Earth.
    """
    frames = len(r_eci_m)
    out = np.empty((2, frames))
    for start in range(0, frames, _CHUNK):  # rays of all frames at once would not fit in memory
        part = slice(start, start + _CHUNK)
        out[:, part] = _chunk_on_plate(
            r_eci_m[part] / earth_radius_m,
            unit(normal_eci[part]),
            r_sun_eci_m[part] / earth_radius_m,
            unit(earth_pole_eci[part]),
            jd_tt[part, None],
            solar_flux_w_m2[part, None],
        )
    return EarthLight(*out)


def _chunk_on_plate(
    r: FloatArray,
    normal: FloatArray,
    sun: FloatArray,
    pole: FloatArray,
    jd_tt: FloatArray,
    flux: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """As :func:`earthlight_on_plate`, lengths in Earth radii: two of (f,)."""
    distance = np.linalg.norm(r, axis=-1)
    down = -r / distance[:, None]
    axes = R_with_z(down)
    # Solid angle goes with the cosine of the angle from nadir.
    share = (1 + _RING_PLACE) / 2
    drop = 1 - np.sqrt((1 - 1 / distance) * (1 + 1 / distance))
    cosine = 1 - drop[:, None] * share
    sine = np.sqrt(1 - cosine**2)
    turn = 2 * np.pi * (np.arange(4 * _RINGS) + 0.5) / (4 * _RINGS)
    rays = np.stack(
        [
            (-sine[..., None] * np.cos(turn)).reshape(len(r), -1),
            (-sine[..., None] * np.sin(turn)).reshape(len(r), -1),
            np.repeat(cosine, 4 * _RINGS, axis=-1),
        ],
        axis=-1,
    )
    rays = np.einsum("fij,fkj->fki", axes, rays)
    along = -np.einsum("fki,fi->fk", rays, r)
    reach = along - np.sqrt(np.maximum(along**2 - (distance**2 - 1)[:, None], 0.0))
    ground = r[:, None, :] + reach[..., None] * rays
    to_sun = unit(sun[:, None, :] - ground)
    sunlit = np.maximum(np.einsum("fki,fki->fk", ground, to_sun), 0.0)
    sin_latitude = np.einsum("fki,fi->fk", ground, pole)
    reflected = albedo(sin_latitude, jd_tt) * sunlit * flux / np.pi
    emitted = emissivity(sin_latitude, jd_tt) * flux / (4 * np.pi)
    weight = np.repeat(_RING_WEIGHT / 2, 4 * _RINGS) * 2 * np.pi / (4 * _RINGS)
    solid_angle = drop[:, None] * weight
    facing = np.maximum(np.einsum("fki,fi->fk", rays, normal), 0.0) * solid_angle
    return np.sum(reflected * facing, axis=-1), np.sum(emitted * facing, axis=-1)
