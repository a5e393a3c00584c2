"""Sunlight near the Earth: the visible share of the Sun's disc, and its irradiance.

The model is conical: Sun and Earth are discs in a plane whose radii and distance are the angles seen
from the spacecraft (Montenbruck & Gill, Satellite Orbits, 2000, section 3.4.2). The Sun is uniformly
bright, the Earth has no atmosphere, and the Moon casts no shadow. Compared with straight rays to a true
sphere, the plane discs have errors of up to 2e-4 of the Sun's disc at 700 km and below 1e-4 from 20 000
km on, since the rim of a wide cap is straighter than that of a plane disc.
"""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._frames import unit


def disc_fraction_in_view(
    radius_rad: FloatArray, other_radius_rad: FloatArray, distance_rad: FloatArray
) -> FloatArray:
    """Share of a disc that remains visible behind another disc; any shape, 0 … 1.

    The area of the overlap is computed by half-angle formulas of the triangle between both centres and a
    crossing of the rims. They keep their accuracy where the rims just touch and where arcs are almost
    straight: the error is below 1e-12 for angles known to rounding.
    """
    a, b, c = np.broadcast_arrays(radius_rad, other_radius_rad, distance_rad)
    # Twice s−a, s−b, s−c of the triangle, all positive where the rims cross. The difference c−b is
    # formed first, since both are almost equal and far larger than a.
    to_rim = c - b
    past_a, past_b, past_c = c + b - a, a + to_rim, a - to_rim
    crossing = (past_a > 0) & (past_b > 0) & (past_c > 0)
    s_a, s_b, s_c = (np.where(crossing, x, 1.0) for x in (past_a, past_b, past_c))
    total = a + b + c
    alpha = 2 * np.arctan2(np.sqrt(s_a * s_c), np.sqrt(total * s_b))
    beta = 2 * np.arctan2(np.sqrt(s_b * s_c), np.sqrt(total * s_a))
    lens = a**2 * _segment(alpha) + b**2 * _segment(beta)
    # Without a crossing, the discs are either apart, or one covers or lies within the other.
    apart = past_c <= 0
    covered = np.where(apart, 0.0, np.minimum(1.0, (b / a) ** 2))
    return np.clip(1.0 - np.where(crossing, lens / (np.pi * a**2), covered), 0.0, 1.0)


def _segment(half_angle_rad: FloatArray) -> FloatArray:
    """Area of the segment of a unit circle with this half angle."""
    return np.asarray(half_angle_rad - np.sin(half_angle_rad) * np.cos(half_angle_rad))


def angle_between_rad(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors (..., 3), (..., 3) → (...,), accurate near 0 and π (Kahan)."""
    u, v = unit(a), unit(b)
    return np.asarray(2 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1)))


def sun_angular_radius_rad(
    r_eci_m: FloatArray, r_sun_eci_m: FloatArray, sun_radius_m: float
) -> FloatArray:
    """Angular radius of the Sun's disc seen from ``r_eci_m``: (..., 3), (..., 3) → (...,)."""
    return np.asarray(np.arcsin(sun_radius_m / np.linalg.norm(r_sun_eci_m - r_eci_m, axis=-1)))


def sun_fraction(
    r_eci_m: FloatArray,
    r_sun_eci_m: FloatArray,
    *,
    earth_radius_m: float,
    sun_radius_m: float,
    flattening: float = 0.0,
    earth_pole_eci: FloatArray | None = None,
) -> FloatArray:
    """Share of the Sun's disc that the Earth does not hide: (..., 3), (..., 3) → (...,), 0 … 1.

    Args:
        r_eci_m, r_sun_eci_m: geocentric positions of the spacecraft and the Sun, in any axes.
        earth_radius_m: equatorial radius of the Earth.
        sun_radius_m: radius of the Sun.
        flattening: of the Earth's ellipsoid; 0 is a sphere.
        earth_pole_eci: (..., 3) unit vector of the Earth's axis, needed if ``flattening`` is not 0.

    Raises:
        InputError: A position is inside the Earth.
    """
    to_sun = r_sun_eci_m - r_eci_m
    if flattening == 0.0:
        distance = np.linalg.norm(r_eci_m, axis=-1)
        _refuse_inside(distance / earth_radius_m)
        earth_rad = np.arcsin(earth_radius_m / distance)
    else:
        if earth_pole_eci is None:
            raise ValueError("a flattened Earth needs its pole")
        earth_rad = _limb_angle_rad(r_eci_m, to_sun, earth_radius_m, flattening, earth_pole_eci)
    sun_rad = sun_angular_radius_rad(r_eci_m, r_sun_eci_m, sun_radius_m)
    return disc_fraction_in_view(sun_rad, earth_rad, angle_between_rad(to_sun, -r_eci_m))


def _limb_angle_rad(
    r_m: FloatArray, to_sun_m: FloatArray, radius_m: float, flattening: float, pole: FloatArray
) -> FloatArray:
    """Angle at the spacecraft from the Earth's centre to its limb on the Sun's side, (...,).

    In the plane of the spacecraft, the Earth's centre and the Sun, the rays u that touch xᵀMx = 1 obey
    uᵀQu = 0 with Q = M r rᵀ M − (rᵀMr − 1) M, a quadratic equation in the tangent of the angle.
    """
    stretch = 1 / (1 - flattening) ** 2 - 1

    def scaled(x: FloatArray) -> FloatArray:
        """M x · radius²"""
        return np.asarray(x + stretch * np.sum(x * pole, axis=-1, keepdims=True) * pole)

    def dot(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(np.sum(x * y, axis=-1))

    r = r_m / radius_m
    outside = dot(r, scaled(r)) - 1
    _refuse_inside(outside + 1)
    down = -unit(r)
    sunward = unit(to_sun_m)
    side = sunward - dot(sunward, down)[..., None] * down
    # Where the Sun is exactly behind or opposite the Earth's centre, every side is equivalent.
    lost = np.linalg.norm(side, axis=-1, keepdims=True) < 1e-12
    any_side = np.cross(down, np.eye(3)[np.argmin(np.abs(down), axis=-1)])
    side = unit(np.where(lost, any_side, side))

    def form(u: FloatArray, w: FloatArray) -> FloatArray:
        """uᵀQw"""
        return np.asarray(dot(scaled(r), u) * dot(scaled(r), w) - outside * dot(u, scaled(w)))

    a, b, c = form(down, down), form(down, side), form(side, side)
    return np.asarray(np.arctan2(b + np.sqrt(b**2 - a * c), -c))


def _refuse_inside(scaled_distance: FloatArray) -> None:
    # The negation makes NaN an error too.
    if not np.all(scaled_distance >= 1):
        raise InputError(
            "the orbit passes below the Earth's surface, where there is no sunlight;"
            " raise its perigee or shorten the times"
        )


def solar_flux_w_m2(
    r_eci_m: FloatArray, r_sun_eci_m: FloatArray, *, solar_constant_w_m2: float, au_m: float
) -> FloatArray:
    """Irradiance of the unshaded Sun on a plate facing it: (..., 3), (..., 3) → (...,)."""
    distance_au = np.linalg.norm(r_sun_eci_m - r_eci_m, axis=-1) / au_m
    return np.asarray(solar_constant_w_m2 / distance_au**2)
