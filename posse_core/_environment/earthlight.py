"""Irradiance from the Earth: sunlight that it reflects, and its own infrared radiation.

Both are summed over patches of the whole cap that a spacecraft sees. Albedo and emissivity depend on
latitude and season (Knocke, Ries & Tapley 1988, AIAA 88-4292): they are zonal means without the clouds
of the day, and the surface is Lambertian. The night side therefore reflects nothing and radiates nearly
as much as the day side. The irradiance is broadband, 0.2 to 50 µm; the Earth in images has its own model
in ``posse_core._sky``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_with_z, unit

_SEASON_RAD_DAY = 2 * np.pi / 365.25
_SEASON_START_JD = 2444960.5
"""22 December 1981, the start of the season in Knocke, Ries & Tapley."""
_RINGS = 8
"""Number of rings of the visible cap (Gauss–Legendre); each has four times as many patches as rings.

The numerical error of the sum is below 0.1 W/m² of up to 400 W/m², far below the model's own error.
"""
_RING_NODE, _RING_WEIGHT = np.polynomial.legendre.leggauss(_RINGS)
_CHUNK = 512


@dataclass(frozen=True)
class EarthLight:
    """Irradiance on a plate, W/m², both (...,)."""

    albedo_w_m2: FloatArray
    infrared_w_m2: FloatArray


def albedo(sin_latitude: FloatArray, jd_tt: FloatArray) -> FloatArray:
    """Share of sunlight that the Earth reflects, by latitude and season; shapes broadcast."""
    season = np.cos(_SEASON_RAD_DAY * (jd_tt - _SEASON_START_JD))
    return np.asarray(0.34 + 0.10 * season * sin_latitude + 0.29 * _legendre_2(sin_latitude))


def emissivity(sin_latitude: FloatArray, jd_tt: FloatArray) -> FloatArray:
    """Infrared exitance divided by a quarter of the solar flux, by latitude and season."""
    season = np.cos(_SEASON_RAD_DAY * (jd_tt - _SEASON_START_JD))
    return np.asarray(0.68 - 0.07 * season * sin_latitude - 0.18 * _legendre_2(sin_latitude))


def _legendre_2(x: FloatArray) -> FloatArray:
    return np.asarray((3 * x**2 - 1) / 2)


@dataclass(frozen=True)
class EarthPatches:
    """The cap of the Earth that is visible from F positions, divided into K patches.

    Attributes:
        directions: (F, K, 3) unit vectors to the patches.
        solid_angle_sr: (F, K) solid angles of the patches; their sum is the cap's.
        reflected_w_m2_sr, emitted_w_m2_sr: (F, K) radiance of reflected sunlight and of the infrared
            radiation, over all wavelengths.
    """

    directions: FloatArray
    solid_angle_sr: FloatArray
    reflected_w_m2_sr: FloatArray
    emitted_w_m2_sr: FloatArray


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
    """Irradiance from the Earth on one side of a plate, at F positions.

    Args:
        normal_eci: (F, 3) the plate's normal, of any length.
        r_eci_m, r_sun_eci_m, earth_pole_eci, jd_tt, solar_flux_w_m2, earth_radius_m: as in
            :func:`earth_patches`.
    """
    frames = len(r_eci_m)
    out = np.empty((2, frames))
    for start in range(0, frames, _CHUNK):  # the rays of all frames would not fit in memory
        part = slice(start, start + _CHUNK)
        patches = earth_patches(
            r_eci_m=r_eci_m[part],
            r_sun_eci_m=r_sun_eci_m[part],
            earth_pole_eci=earth_pole_eci[part],
            jd_tt=jd_tt[part],
            solar_flux_w_m2=solar_flux_w_m2[part],
            earth_radius_m=earth_radius_m,
        )
        cosine = np.einsum("fki,fi->fk", patches.directions, unit(normal_eci[part]))
        facing = np.maximum(cosine, 0.0) * patches.solid_angle_sr
        out[0, part] = np.sum(patches.reflected_w_m2_sr * facing, axis=-1)
        out[1, part] = np.sum(patches.emitted_w_m2_sr * facing, axis=-1)
    return EarthLight(*out)


def earth_patches(
    *,
    r_eci_m: FloatArray,
    r_sun_eci_m: FloatArray,
    earth_pole_eci: FloatArray,
    jd_tt: FloatArray,
    solar_flux_w_m2: FloatArray,
    earth_radius_m: float,
) -> EarthPatches:
    """The visible cap of the Earth and its radiance, at F positions.

    Args:
        r_eci_m, r_sun_eci_m: (F, 3) positions of the observer and the Sun from the Earth's centre, in
            any axes; the patches' directions are in the same.
        earth_pole_eci: (F, 3) the Earth's pole, of any length.
        jd_tt: (F,) Julian dates, for the season.
        solar_flux_w_m2: (F,) at the Earth.
        earth_radius_m: radius of the Earth.
    """
    r = r_eci_m / earth_radius_m
    sun = r_sun_eci_m / earth_radius_m
    distance = np.linalg.norm(r, axis=-1)
    down = -r / distance[:, None]
    axes = R_with_z(down)
    # The solid angle is proportional to the range of the cosine of the angle from nadir.
    share = (1 + _RING_NODE) / 2
    # Above a pole, an orbit may be inside the sphere and above the flattened Earth.
    drop = 1 - np.sqrt(np.maximum((1 - 1 / distance) * (1 + 1 / distance), 0.0))
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
    sin_latitude = np.einsum("fki,fi->fk", ground, unit(earth_pole_eci))
    flux, jd = solar_flux_w_m2[:, None], jd_tt[:, None]
    weight = np.repeat(_RING_WEIGHT / 2, 4 * _RINGS) * 2 * np.pi / (4 * _RINGS)
    return EarthPatches(
        directions=rays,
        solid_angle_sr=drop[:, None] * weight,
        reflected_w_m2_sr=albedo(sin_latitude, jd) * sunlit * flux / np.pi,
        emitted_w_m2_sr=emissivity(sin_latitude, jd) * flux / (4 * np.pi),
    )
