"""Accelerations of a spacecraft near the Earth, as casadi expressions in SI units, inertial axes."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

# Base altitude (km), density there (kg/m³), scale height (km): Vallado (2013), table 8-4.
_ATMOSPHERE = np.array(
    [
        (0, 1.225, 7.249),
        (25, 3.899e-2, 6.349),
        (30, 1.774e-2, 6.682),
        (40, 3.972e-3, 7.554),
        (50, 1.057e-3, 8.382),
        (60, 3.206e-4, 7.714),
        (70, 8.770e-5, 6.549),
        (80, 1.905e-5, 5.799),
        (90, 3.396e-6, 5.382),
        (100, 5.297e-7, 5.877),
        (110, 9.661e-8, 7.263),
        (120, 2.438e-8, 9.473),
        (130, 8.484e-9, 12.636),
        (140, 3.845e-9, 16.149),
        (150, 2.070e-9, 22.523),
        (180, 5.464e-10, 29.740),
        (200, 2.789e-10, 37.105),
        (250, 7.248e-11, 45.546),
        (300, 2.418e-11, 53.628),
        (350, 9.518e-12, 53.298),
        (400, 3.725e-12, 58.515),
        (450, 1.585e-12, 60.828),
        (500, 6.967e-13, 63.822),
        (600, 1.454e-13, 71.835),
        (700, 3.614e-14, 88.667),
        (800, 1.170e-14, 124.64),
        (900, 5.245e-15, 181.05),
        (1000, 3.019e-15, 268.00),
    ]
)


def two_body(r: Any, mu: Any) -> Any:
    """(3) point mass at the origin."""
    return -mu * r / ca.sumsqr(r) ** 1.5


def two_body_difference(r: Any, dr: Any, mu: Any) -> Any:
    """(3) two_body(r + dr) − two_body(r) without cancellation (Battin 1999, section 8.4)."""
    q = ca.dot(dr, dr + 2 * r) / ca.sumsqr(r)
    grown = (1 + q) ** 1.5
    f = q * (3 + 3 * q + q**2) / (1 + grown)
    return -mu / (ca.sumsqr(r) ** 1.5 * grown) * (dr - f * r)


def oblateness(r: Any, mu: Any, radius: Any, j2: Any) -> Any:
    """(3) second zonal harmonic about the z axis (Vallado 2013, eq. 8-30)."""
    r2 = ca.sumsqr(r)
    k = -1.5 * j2 * mu * radius**2 / r2**2.5
    z2 = 5 * r[2] ** 2 / r2
    return k * ca.vertcat(r[0] * (1 - z2), r[1] * (1 - z2), r[2] * (3 - z2))


def third_body(r: Any, r_body: Any, mu_body: Any) -> Any:
    """(3) attraction of a distant body minus its attraction of the Earth, without cancellation."""
    return two_body_difference(r_body, -r, mu_body) * -1


def density(r: Any, radius: Any) -> Any:
    """Air density, kg/m³: piecewise exponential in the height above a sphere."""
    height_km = (ca.norm_2(r) - radius) / 1e3
    base, rho, scale = _ATMOSPHERE[0]
    result = rho * ca.exp(-(height_km - base) / scale)
    for base, rho, scale in _ATMOSPHERE[1:]:
        layer = rho * ca.exp(-(height_km - base) / scale)
        result = ca.if_else(height_km >= base, layer, result)
    return result


def drag(r: Any, v: Any, radius: Any, earth_rate: Any, ballistic_m2_kg: Any) -> Any:
    """(3) drag in an atmosphere that rotates with the Earth; ``ballistic_m2_kg`` is C_D A/m."""
    wind = ca.cross(ca.vertcat(0, 0, earth_rate), r)
    relative = v - wind
    return -0.5 * density(r, radius) * ballistic_m2_kg * ca.norm_2(relative) * relative


def solar_pressure(
    r: Any, r_sun: Any, pressure_n_m2: Any, au: Any, radius: Any, sun_radius: Any, c_r_a_m2_kg: Any
) -> Any:
    """(3) radiation pressure on a sphere; ``c_r_a_m2_kg`` is C_R A/m.

    In the penumbra the sunlight falls as a cubic in the angle between the two centres, which is smooth,
    as integrators need it, and within 2 % of the visible share of the disc. Labels use the exact share.
    """
    to_sun = r_sun - r
    distance = ca.norm_2(to_sun)
    r_norm = ca.norm_2(r)
    angle = ca.atan2(ca.norm_2(ca.cross(-r, to_sun)), ca.dot(-r, to_sun))
    earth = ca.asin(ca.fmin(radius / r_norm, 1.0))
    sun = ca.asin(sun_radius / distance)
    x = ca.fmin(ca.fmax((angle - (earth - sun)) / (2 * sun), 0.0), 1.0)
    light = x**2 * (3 - 2 * x)
    return -light * pressure_n_m2 * c_r_a_m2_kg * au**2 * to_sun / distance**3
