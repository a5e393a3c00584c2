"""Relative motion under the Earth's oblateness: secular J2 in ROE, mean ↔ osculating elements.

Two first-order theories convert mean to osculating elements: ``brouwer-lyddane``, the published one
(:mod:`posse_core._dynamics.brouwer`), and ``canonical``, defined here, which applies Brouwer's
short-period generating function to equinoctial elements as a Poisson bracket. The latter leaves the
long-period part in the mean elements, where it hardly changes over tens of orbits. It has no
singularity.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.brouwer import BROUWER_LYDDANE
from posse_core._dynamics.elements import (
    EQUINOCTIAL_FROM_STATE,
    STATE_FROM_EQUINOCTIAL,
    equinoctial_from_qns,
    qns_from_equinoctial,
    qns_sign,
)
from posse_core._dynamics.rows import Rows, dense

Theory: TypeAlias = Literal["brouwer-lyddane", "canonical"]


def _earth() -> tuple[Any, Any]:
    """Column μ, Rₑ, J₂, and its parts."""
    earth = ca.SX.sym("mu_radius_j2", 3)
    return earth, ca.vertsplit(earth)


def _stm() -> Any:
    """Koenig, Guffanti, D'Amico (2017), J. Guidance 40, 1749, eq. A6."""
    chief, t = ca.SX.sym("mean_chief_qns", 6), ca.SX.sym("t_s")
    earth, (mu, radius, j2) = _earth()
    a, _, ex, ey, i, _ = ca.vertsplit(chief)
    eta = ca.sqrt(1 - ex**2 - ey**2)
    n = ca.sqrt(mu / a**3)
    kappa = 0.75 * j2 * radius**2 * ca.sqrt(mu) / (a**3.5 * eta**4)
    E, F, G = 1 + eta, 4 + 3 * eta, 1 / eta**2
    P, Q = 3 * ca.cos(i) ** 2 - 1, 5 * ca.cos(i) ** 2 - 1
    S, T = ca.sin(2 * i), ca.sin(i) ** 2
    k = kappa * t
    c, s = ca.cos(k * Q), ca.sin(k * Q)
    fx, fy = ex * c - ey * s, ex * s + ey * c
    x, y = 4 * k * G * Q * fx, 4 * k * G * Q * fy
    rows = [
        [1, 0, 0, 0, 0, 0],
        [-1.5 * n * t - 3.5 * k * E * P, 1, k * ex * F * G * P, k * ey * F * G * P, -k * F * S, 0],
        [3.5 * k * fy * Q, 0, c - ex * y, -s - ey * y, 5 * k * fy * S, 0],
        [-3.5 * k * fx * Q, 0, s + ex * x, c + ey * x, -5 * k * fx * S, 0],
        [0, 0, 0, 0, 1, 0],
        [3.5 * k * S, 0, -4 * k * ex * G * S, -4 * k * ey * G * S, 2 * k * T, 1],
    ]
    phi = ca.vertcat(*(ca.horzcat(*row) for row in rows))
    return dense("j2_stm", {"mean_chief_qns": chief, "mu_radius_j2": earth, "t_s": t}, {"phi": phi})


def _secular() -> Any:
    """Mean qns elements after t: first-order secular rates of J2 (Brouwer 1959)."""
    start, t = ca.SX.sym("mean_qns", 6), ca.SX.sym("t_s")
    earth, (mu, radius, j2) = _earth()
    a, u, ex, ey, i, raan = ca.vertsplit(start)
    eta = ca.sqrt(1 - ex**2 - ey**2)
    kappa = 0.75 * j2 * radius**2 * ca.sqrt(mu) / (a**3.5 * eta**4)
    cos_i = ca.cos(i)
    argp_rate = kappa * (5 * cos_i**2 - 1)
    anomaly_rate = ca.sqrt(mu / a**3) + kappa * eta * (3 * cos_i**2 - 1)
    c, s = ca.cos(argp_rate * t), ca.sin(argp_rate * t)
    end = ca.vertcat(
        a,
        u + (argp_rate + anomaly_rate) * t,
        ex * c - ey * s,
        ex * s + ey * c,
        i,
        raan - 2 * kappa * cos_i * t,
    )
    return dense("j2_secular", {"mean_qns": start, "mu_radius_j2": earth, "t_s": t}, {"qns": end})


def _short_period() -> Any:
    """First-order short-period part of J2 as a change of equinoctial elements.

    Brouwer's generating function S of the short-period terms (1959, Astronomical Journal 64, 378,
    eq. 15) is written in position and velocity, where it is smooth at e = 0 and i = 0. The change of any
    element is its Poisson bracket with S, whose derivatives casadi computes.
    """
    r, v = ca.SX.sym("r_m", 3), ca.SX.sym("v_m_s", 3)
    sign = ca.SX.sym("sign")
    earth, (mu, radius, j2) = _earth()
    h = ca.cross(r, v)
    G = ca.norm_2(h)
    r_norm = ca.norm_2(r)
    a = 1 / (2 / r_norm - ca.sumsqr(v) / mu)
    e_cos_f = G**2 / (mu * r_norm) - 1
    e_sin_f = G * ca.dot(r, v) / (mu * r_norm)
    eta = G / ca.sqrt(mu * a)
    e_cos_E, e_sin_E = 1 - r_norm / a, ca.dot(r, v) / ca.sqrt(mu * a)
    # Equation of the centre without either anomaly: f − E from its half angle, E − M = e sin E.
    f_minus_E = 2 * ca.atan2(e_sin_E, 1 + eta - e_cos_E)
    centre = f_minus_E + e_sin_E
    # sin i times sine and cosine of the argument of latitude, from the height above the equator.
    sin_sin = r[2] / r_norm
    sin_cos = (r_norm * v[2] - ca.dot(r, v) * sin_sin) / G
    sin_2 = 2 * sin_sin * sin_cos
    cos_2 = sin_cos**2 - sin_sin**2
    sin2_i = 1 - (h[2] / G) ** 2
    # e times sin²i sin(2u ∓ f), u = g + f: Brouwer's 2g + f and 2g + 3f.
    e_minus = sin_2 * e_cos_f - cos_2 * e_sin_f
    e_plus = sin_2 * e_cos_f + cos_2 * e_sin_f
    S = (
        mu**2
        * j2
        * radius**2
        / (2 * G**3)
        * ((1 - 1.5 * sin2_i) * (centre + e_sin_f) + 1.5 * (0.5 * sin_2 + 0.5 * e_minus + e_plus / 6))
    )
    elements = EQUINOCTIAL_FROM_STATE.function(r, v, sign, mu)
    change = -(
        ca.jacobian(elements, r) @ ca.gradient(S, v) - ca.jacobian(elements, v) @ ca.gradient(S, r)
    )
    at = ca.SX.sym("equinoctial", 6)
    r_at, v_at = STATE_FROM_EQUINOCTIAL.function(at, sign, mu)
    inner = ca.Function("bracket", [r, v, sign, earth], [change])
    return dense(
        "j2_short_period",
        {"equinoctial": at, "sign": sign, "mu_radius_j2": earth},
        {"change": inner(r_at, v_at, sign, earth)},
    )


J2_STM = Rows(_stm)
"""casadi Function (mean chief qns, (μ, Rₑ, J₂), t) → (6, 6) state-transition matrix of mean ROE."""
J2_SECULAR = Rows(_secular)
"""casadi Function (mean qns, (μ, Rₑ, J₂), t) → mean qns at t."""
J2_SHORT_PERIOD = Rows(_short_period)
"""casadi Function (mean equinoctial, I, (μ, Rₑ, J₂)) → osculating minus mean, equinoctial."""


def _column(constants: Constants) -> FloatArray:
    return np.array([constants.mu_earth_m3_s2, constants.earth_radius_m, constants.j2])


def j2_stm(mean_chief_qns: FloatArray, constants: Constants, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6, 6): mean ROE at t from those at 0. See :data:`J2_STM`."""
    return np.asarray(J2_STM(mean_chief_qns, _column(constants), t_s))


def j2_secular(mean_qns: FloatArray, constants: Constants, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6): mean elements at t. See :data:`J2_SECULAR`."""
    return np.asarray(J2_SECULAR(mean_qns, _column(constants), t_s))


def osculating_from_mean(mean_qns: FloatArray, constants: Constants, theory: Theory) -> FloatArray:
    """(..., 6) mean qns → (..., 6) osculating qns."""
    if theory == "brouwer-lyddane":
        return _near(np.asarray(BROUWER_LYDDANE(mean_qns, _column(constants))), mean_qns)
    sign = qns_sign(mean_qns)
    mean = equinoctial_from_qns(mean_qns, sign)
    change = np.asarray(J2_SHORT_PERIOD(mean, sign, _column(constants)))
    return _near(qns_from_equinoctial(mean + change, sign), mean_qns)


def mean_from_osculating(qns: FloatArray, constants: Constants, theory: Theory) -> FloatArray:
    """(..., 6) osculating qns → (..., 6) mean qns: the inverse of :func:`osculating_from_mean`."""
    sign = qns_sign(qns)
    wanted = mean = equinoctial_from_qns(qns, sign)
    for _ in range(_INVERSIONS):
        now = osculating_from_mean(qns_from_equinoctial(mean, sign), constants, theory)
        missing = wanted - equinoctial_from_qns(now, sign)
        missing[..., 1] -= 2 * np.pi * np.round(missing[..., 1] / (2 * np.pi))
        mean = mean + missing
    return _near(qns_from_equinoctial(mean, sign), qns)


_INVERSIONS = 8
"""Number of fixed-point steps; each reduces the error by a factor of about J2 (1e-3)."""


def _near(qns: FloatArray, reference: FloatArray) -> FloatArray:
    """The same elements with u and Ω shifted by whole turns to be nearest to the reference's."""
    out = qns.copy()
    for k in (1, 5):
        turns = np.round((out[..., k] - reference[..., k]) / (2 * np.pi))
        out[..., k] -= 2 * np.pi * turns
    return out
