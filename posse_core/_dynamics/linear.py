"""Linear relative motion in closed form: state-transition matrices and maps.

States are RTN position (m) and velocity (m/s) in the rotating frame. Each matrix is a casadi Function of
the chief's qns elements at t = 0, μ and t, so its Jacobians follow by automatic differentiation (AD).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.elements import in_plane
from posse_core._dynamics.roe import RTN_FROM_ROE
from posse_core._dynamics.rows import Rows, dense


def _hcw() -> Any:
    chief, mu, t = ca.SX.sym("chief_qns", 6), ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    n = ca.sqrt(mu / chief[0] ** 3)
    s, c = ca.sin(n * t), ca.cos(n * t)
    phi = _rows(
        [4 - 3 * c, 0, 0, s / n, 2 * (1 - c) / n, 0],
        [6 * (s - n * t), 1, 0, 2 * (c - 1) / n, 4 * s / n - 3 * t, 0],
        [0, 0, c, 0, 0, s / n],
        [3 * n * s, 0, 0, c, 2 * s, 0],
        [6 * n * (c - 1), 0, 0, -2 * s, 4 * c - 3, 0],
        [0, 0, -n * s, 0, 0, c],
    )
    return dense("hcw", {"chief_qns": chief, "mu_m3_s2": mu, "t_s": t}, {"phi": phi})


def _near_circular() -> Any:
    chief, mu, t = ca.SX.sym("chief_qns", 6), ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    a = chief[0]
    n = ca.sqrt(mu / a**3)
    u = chief[1] + n * t
    s, c = ca.sin(u), ca.cos(u)
    drift = -1.5 * n * t
    position = [
        [1, 0, -c, -s, 0, 0],
        [drift, 1, 2 * s, -2 * c, 0, 0],
        [0, 0, 0, 0, s, -c],
    ]
    velocity = [
        [0, 0, n * s, -n * c, 0, 0],
        [-1.5 * n, 0, 2 * n * c, 2 * n * s, 0, 0],
        [0, 0, 0, 0, n * c, n * s],
    ]
    matrix = a * _rows(*position, *velocity)
    return dense("near_circular", {"chief_qns": chief, "mu_m3_s2": mu, "t_s": t}, {"map": matrix})


def _yamanaka_ankersen() -> Any:
    chief, mu, t = ca.SX.sym("chief_qns", 6), ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    a, u, ex, ey, _, _ = ca.vertsplit(chief)
    e, argp = ca.sqrt(ex**2 + ey**2), ca.atan2(ey, ex)
    n = ca.sqrt(mu / a**3)
    x_0, y_0, _, _, _, h = in_plane(a, u, ex, ey, mu)
    x_1, y_1, _, _, _, _ = in_plane(a, u + n * t, ex, ey, mu)
    theta_0, theta_1 = ca.atan2(y_0, x_0) - argp, ca.atan2(y_1, x_1) - argp
    k2 = mu**2 / h**3  # h / p²

    def shape(theta: Any) -> tuple[Any, Any, Any]:
        rho = 1 + e * ca.cos(theta)
        return rho, rho * ca.sin(theta), rho * ca.cos(theta)

    rho, s, c = shape(theta_0)
    inverse = _rows(
        [1 - e**2, 3 * e * s / rho * (1 + 1 / rho), -e * s * (1 + 1 / rho), 2 - e * c],
        [0, -3 * s / rho * (1 + e**2 / rho), s * (1 + 1 / rho), c - 2 * e],
        [0, -3 * (c / rho + e), c * (1 + 1 / rho) + e, -s],
        [0, 3 * rho + e**2 - 1, -(rho**2), e * s],
    ) / (1 - e**2)
    rho, s, c = shape(theta_1)
    J = k2 * t
    ds = ca.cos(theta_1) + e * ca.cos(2 * theta_1)
    dc = -(ca.sin(theta_1) + e * ca.sin(2 * theta_1))
    forward = _rows(
        [1, -c * (1 + 1 / rho), s * (1 + 1 / rho), 3 * rho**2 * J],
        [0, s, c, 2 - 3 * e * s * J],
        [0, 2 * s, 2 * c - e, 3 * (1 - 2 * e * s * J)],
        [0, ds, dc, -3 * e * (ds * J + s / rho**2)],
    )
    turn = theta_1 - theta_0
    out = _rows([ca.cos(turn), ca.sin(turn)], [-ca.sin(turn), ca.cos(turn)])
    phi = (
        _YA_FROM_RTN.T
        @ _unscaling(e, theta_1, k2)
        @ ca.diagcat(forward @ inverse, out)
        @ _scaling(e, theta_0, k2)
        @ _YA_FROM_RTN
    )
    return dense("yamanaka_ankersen", {"chief_qns": chief, "mu_m3_s2": mu, "t_s": t}, {"phi": phi})


def _scaling(e: Any, theta: Any, k2: Any) -> Any:
    """Yamanaka and Ankersen's eq. 70: positions times ρ, velocities with respect to θ."""
    rho = 1 + e * ca.cos(theta)
    matrix = ca.SX(6, 6)
    for position, velocity in _YA_PAIRS:
        matrix[position, position] = rho
        matrix[velocity, position] = -e * ca.sin(theta)
        matrix[velocity, velocity] = 1 / (k2 * rho)
    return matrix


def _unscaling(e: Any, theta: Any, k2: Any) -> Any:
    rho = 1 + e * ca.cos(theta)
    matrix = ca.SX(6, 6)
    for position, velocity in _YA_PAIRS:
        matrix[position, position] = 1 / rho
        matrix[velocity, position] = k2 * e * ca.sin(theta)
        matrix[velocity, velocity] = k2 * rho
    return matrix


def _any_eccentricity() -> Any:
    chief, mu, t = ca.SX.sym("chief_qns", 6), ca.SX.sym("mu_m3_s2"), ca.SX.sym("t_s")
    roe = ca.SX.sym("roe", 6)
    jacobian = ca.jacobian(RTN_FROM_ROE.function(chief, roe, mu, t), roe)
    matrix = ca.substitute(jacobian, roe, ca.SX.zeros(6))
    return dense("any_eccentricity", {"chief_qns": chief, "mu_m3_s2": mu, "t_s": t}, {"map": matrix})


def _rows(*rows: list[Any]) -> Any:
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


_YA_PAIRS = ((0, 2), (1, 3), (4, 5))
_YA_FROM_RTN = _rows(
    [0, 1, 0, 0, 0, 0],
    [-1, 0, 0, 0, 0, 0],
    [0, 0, 0, 0, 1, 0],
    [0, 0, 0, -1, 0, 0],
    [0, 0, 1, 0, 0, 0],
    [0, 0, 0, 0, 0, 1],
)
"""RTN state → x, z, ẋ, ż in plane (x along T, z along −R), then out of plane (along N)."""

HCW = Rows(_hcw)
"""casadi Function (chief qns, μ, t) → (6, 6) state-transition matrix: Hill (1878), Clohessy and
Wiltshire (1960). Circular chief."""
NEAR_CIRCULAR = Rows(_near_circular)
"""casadi Function (chief qns, μ, t) → (6, 6) map from dimensionless qns ROE at t = 0 to the RTN state
at t: D'Amico (2010), eq. 2.17, with u = ω + M."""
YAMANAKA_ANKERSEN = Rows(_yamanaka_ankersen)
"""casadi Function (chief qns, μ, t) → (6, 6) state-transition matrix: Yamanaka and Ankersen (2002),
J. Guidance 25, 60, eqs 82–86. Any e < 1."""
ANY_ECCENTRICITY = Rows(_any_eccentricity)
"""casadi Function (chief qns, μ, t) → (6, 6) map from dimensionless qns ROE at t = 0 to the RTN state
at t: the Jacobian of the exact map at zero, by AD. Any e < 1."""


def hcw_stm(chief_qns: FloatArray, mu_m3_s2: float, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6, 6): RTN state at t from that at 0. See :data:`HCW`."""
    return np.asarray(HCW(chief_qns, mu_m3_s2, t_s))


def near_circular_map(chief_qns: FloatArray, mu_m3_s2: float, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6, 6): RTN state at t from ROE at 0. See :data:`NEAR_CIRCULAR`."""
    return np.asarray(NEAR_CIRCULAR(chief_qns, mu_m3_s2, t_s))


def yamanaka_ankersen_stm(chief_qns: FloatArray, mu_m3_s2: float, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6, 6): RTN state at t from that at 0.
    See :data:`YAMANAKA_ANKERSEN`."""
    return np.asarray(YAMANAKA_ANKERSEN(chief_qns, mu_m3_s2, t_s))


def any_eccentricity_map(chief_qns: FloatArray, mu_m3_s2: float, t_s: FloatArray | float) -> FloatArray:
    """(..., 6), (...,) → (..., 6, 6): RTN state at t from ROE at 0. See :data:`ANY_ECCENTRICITY`."""
    return np.asarray(ANY_ECCENTRICITY(chief_qns, mu_m3_s2, t_s))
