"""Orbital elements: Keplerian, quasi-nonsingular, equinoctial; and Cartesian states.

Element rows (6 numbers, lengths in m, angles in rad):
    keplerian    a, e, i, Ω, ω, M
    qns          a, u, ex, ey, i, Ω      u = ω + M, (ex, ey) = e (cos ω, sin ω)
    equinoctial  a, l, ex, ey, p, q      l = M + ω + IΩ, (ex, ey) = e (cos, sin)(ω + IΩ),
                                         (p, q) = tan(i/2)^I (sin Ω, cos Ω)

I is +1 for inclinations below 90° and −1 above, so that no elliptic orbit is near the singularity of its
set (Broucke & Cefola 1972, Celestial Mechanics 5, 303). All conversions pass through the equinoctial set
and none divides by e or sin i. An undefined angle is 0: ω at e = 0, Ω at i = 0 and 180°. States are
position (m) and velocity (m/s) in inertial axes.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.kepler import CORRECTIONS, eccentric_longitude
from posse_core._dynamics.rows import Rows, dense


def columns(rows: FloatArray) -> list[FloatArray]:
    """(..., n) → n arrays (...,)."""
    return [rows[..., k] for k in range(rows.shape[-1])]


def in_plane(
    a: Any, longitude: Any, ex: Any, ey: Any, mu: Any, corrections: int = CORRECTIONS
) -> tuple[Any, ...]:
    """Casadi expressions x, y, vx, vy, r, h in the orbital plane, whose x axis has longitude 0."""
    F = eccentric_longitude(longitude, ex, ey, corrections)
    s, c = ca.sin(F), ca.cos(F)
    eta = ca.sqrt(1 - ex**2 - ey**2)
    b = 1 / (1 + eta)
    r = a * (1 - ex * c - ey * s)
    speed = ca.sqrt(mu * a) / r
    x = a * ((1 - ey**2 * b) * c + ex * ey * b * s - ex)
    y = a * ((1 - ex**2 * b) * s + ex * ey * b * c - ey)
    vx = speed * (ex * ey * b * c - (1 - ey**2 * b) * s)
    vy = speed * ((1 - ex**2 * b) * c - ex * ey * b * s)
    return x, y, vx, vy, r, ca.sqrt(mu * a) * eta


def equinoctial_axes(p: Any, q: Any, sign: Any) -> tuple[Any, Any, Any]:
    """Casadi columns f, g, w of the equinoctial frame, in inertial axes."""
    k = 1 / (1 + p**2 + q**2)
    f = k * ca.vertcat(1 - p**2 + q**2, 2 * p * q, -2 * p * sign)
    g = k * ca.vertcat(2 * p * q * sign, (1 + p**2 - q**2) * sign, 2 * q)
    w = k * ca.vertcat(2 * p, -2 * q, (1 - p**2 - q**2) * sign)
    return f, g, w


def _state_from_equinoctial() -> Any:
    elements, sign, mu = ca.SX.sym("elements", 6), ca.SX.sym("sign"), ca.SX.sym("mu_m3_s2")
    a, l, ex, ey, p, q = ca.vertsplit(elements)
    x, y, vx, vy, _, _ = in_plane(a, l, ex, ey, mu)
    f, g, _ = equinoctial_axes(p, q, sign)
    return dense(
        "state_from_equinoctial",
        {"elements": elements, "sign": sign, "mu_m3_s2": mu},
        {"r_m": x * f + y * g, "v_m_s": vx * f + vy * g},
    )


def _equinoctial_from_state() -> Any:
    r, v = ca.SX.sym("r_m", 3), ca.SX.sym("v_m_s", 3)
    sign, mu = ca.SX.sym("sign"), ca.SX.sym("mu_m3_s2")
    h = ca.cross(r, v)
    r_norm, h_norm = ca.norm_2(r), ca.norm_2(h)
    a = 1 / (2 / r_norm - ca.sumsqr(v) / mu)
    w = h / h_norm
    p, q = w[0] / (1 + sign * w[2]), -w[1] / (1 + sign * w[2])
    f, g, _ = equinoctial_axes(p, q, sign)
    e_vector = ca.cross(v, h) / mu - r / r_norm
    ex, ey = ca.dot(e_vector, f), ca.dot(e_vector, g)
    x, y = ca.dot(r, f), ca.dot(r, g)
    eta = h_norm / ca.sqrt(mu * a)
    b = 1 / (1 + eta)
    cos_F = ex + ((1 - ex**2 * b) * x - ex * ey * b * y) / (a * eta)
    sin_F = ey + ((1 - ey**2 * b) * y - ex * ey * b * x) / (a * eta)
    l = ca.atan2(sin_F, cos_F) - ex * sin_F + ey * cos_F
    return dense(
        "equinoctial_from_state",
        {"r_m": r, "v_m_s": v, "sign": sign, "mu_m3_s2": mu},
        {"elements": ca.vertcat(a, l, ex, ey, p, q)},
    )


STATE_FROM_EQUINOCTIAL = Rows(_state_from_equinoctial)
"""casadi Function (elements (6), sign, μ) → position (3) m, velocity (3) m/s."""
EQUINOCTIAL_FROM_STATE = Rows(_equinoctial_from_state)
"""casadi Function (position (3) m, velocity (3) m/s, sign, μ) → elements (6); elliptic orbits."""


def equinoctial_sign(r_m: FloatArray, v_m_s: FloatArray) -> FloatArray:
    """(..., 3), (..., 3) → (...,) I of the equinoctial set: +1 prograde, −1 retrograde."""
    h_z = r_m[..., 0] * v_m_s[..., 1] - r_m[..., 1] * v_m_s[..., 0]
    return np.where(h_z >= 0, 1.0, -1.0)


def state_from_equinoctial(
    elements: FloatArray, sign: FloatArray | float, mu_m3_s2: float
) -> tuple[FloatArray, FloatArray]:
    """(..., 6), (...,) → position and velocity, (..., 3) each; e < 1."""
    r_m, v_m_s = STATE_FROM_EQUINOCTIAL(elements, sign, mu_m3_s2)
    return r_m, v_m_s


def equinoctial_from_state(
    r_m: FloatArray, v_m_s: FloatArray, sign: FloatArray | float, mu_m3_s2: float
) -> FloatArray:
    """(..., 3), (..., 3), (...,) → (..., 6); NaN where the orbit is not elliptic."""
    result: FloatArray = EQUINOCTIAL_FROM_STATE(r_m, v_m_s, sign, mu_m3_s2)
    return result


def qns_from_equinoctial(elements: FloatArray, sign: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6)."""
    a, l, ex, ey, p, q = columns(elements)
    raan = np.arctan2(p, q)
    turn = sign * raan
    half = np.arctan(np.hypot(p, q))
    i = np.where(np.asarray(sign) > 0, 2 * half, np.pi - 2 * half)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack([a, l - turn, ex * cos + ey * sin, ey * cos - ex * sin, i, raan], axis=-1)


def equinoctial_from_qns(elements: FloatArray, sign: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6). ``sign`` may be either but at its own singularity."""
    a, u, ex, ey, i, raan = columns(elements)
    turn = sign * raan
    tangent = np.tan(np.where(np.asarray(sign) > 0, i, np.pi - i) / 2)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack(
        [
            a,
            u + turn,
            ex * cos - ey * sin,
            ey * cos + ex * sin,
            tangent * np.sin(raan),
            tangent * np.cos(raan),
        ],
        axis=-1,
    )


def keplerian_from_qns(elements: FloatArray) -> FloatArray:
    """(..., 6) → (..., 6); ω = 0 where e = 0."""
    a, u, ex, ey, i, raan = columns(elements)
    argp = np.arctan2(ey, ex)
    return np.stack([a, np.hypot(ex, ey), i, raan, argp, u - argp], axis=-1)


def qns_from_keplerian(elements: FloatArray) -> FloatArray:
    """(..., 6) → (..., 6)."""
    a, e, i, raan, argp, mean_anomaly = columns(elements)
    return np.stack([a, argp + mean_anomaly, e * np.cos(argp), e * np.sin(argp), i, raan], axis=-1)


def qns_sign(elements: FloatArray) -> FloatArray:
    """(..., 6) qns → (...,) I of the equinoctial set."""
    return np.where(elements[..., 4] <= np.pi / 2, 1.0, -1.0)


def state_from_qns(elements: FloatArray, mu_m3_s2: float) -> tuple[FloatArray, FloatArray]:
    """(..., 6) → position and velocity, (..., 3) each."""
    sign = qns_sign(elements)
    return state_from_equinoctial(equinoctial_from_qns(elements, sign), sign, mu_m3_s2)


def qns_from_state(r_m: FloatArray, v_m_s: FloatArray, mu_m3_s2: float) -> FloatArray:
    """(..., 3), (..., 3) → (..., 6)."""
    sign = equinoctial_sign(r_m, v_m_s)
    return qns_from_equinoctial(equinoctial_from_state(r_m, v_m_s, sign, mu_m3_s2), sign)


def state_from_keplerian(elements: FloatArray, mu_m3_s2: float) -> tuple[FloatArray, FloatArray]:
    """(..., 6) → position and velocity, (..., 3) each."""
    return state_from_qns(qns_from_keplerian(elements), mu_m3_s2)


def keplerian_from_state(r_m: FloatArray, v_m_s: FloatArray, mu_m3_s2: float) -> FloatArray:
    """(..., 3), (..., 3) → (..., 6)."""
    return keplerian_from_qns(qns_from_state(r_m, v_m_s, mu_m3_s2))


def later(elements: FloatArray, mu_m3_s2: float, t_s: FloatArray) -> FloatArray:
    """Equinoctial or qns elements after t_s of two-body motion: (6,), (...,) → (..., 6)."""
    out = np.broadcast_to(elements, (*np.shape(t_s), 6)).copy()
    out[..., 1] += np.fmod(np.sqrt(mu_m3_s2 / elements[0] ** 3) * t_s, 2 * np.pi)
    return out
