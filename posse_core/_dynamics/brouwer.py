"""Mean → osculating elements under J2 by the theory of Brouwer and Lyddane, in its published form.

Brouwer (1959), Astronomical Journal 64, 378, and Lyddane (1963), ibid. 68, 555, to first order of J2, in
the form of Schaub and Junkins (2018), Analytical Mechanics of Space Systems, appendix F, whose printed
long-period terms of M, ω and Ω lack Brouwer's factor sin 2ω.

The theory is implemented as it is used elsewhere, with its known limits. The sum M + ω + Ω lacks a
short-period part of the order e J2. At e below J2, the neglected second-order terms depend on ω and M
separately, so the relative state of orbits 100 m apart is accurate to a few cm only. The long-period
terms are singular at the critical inclinations, 63.43° and 116.57°. :mod:`posse_core._dynamics.j2` has a
form without these three limits.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from posse_core._dynamics.kepler import eccentric_longitude
from posse_core._dynamics.rows import Rows, dense


def _osculating() -> Any:
    mean, earth = ca.SX.sym("mean_qns", 6), ca.SX.sym("mu_radius_j2", 3)
    _, radius, j2 = ca.vertsplit(earth)
    a, u, ex, ey, i, raan = ca.vertsplit(mean)
    e, w = ca.sqrt(ex**2 + ey**2), ca.atan2(ey, ex)
    M = u - w
    eta = ca.sqrt(1 - e**2)
    g2 = j2 / 2 * (radius / a) ** 2
    g = g2 / eta**4
    c = ca.cos(i)
    c2 = c**2
    s2 = 1 - c2
    k = 1 - 5 * c2
    E = eccentric_longitude(M, e, 0)
    E_minus_M = e * ca.sin(E)
    f_minus_E = 2 * ca.atan2(e * ca.sin(E), 1 + eta - e * ca.cos(E))
    f = M + E_minus_M + f_minus_E
    centre = f_minus_E + E_minus_M + e * ca.sin(f)
    cf = ca.cos(f)
    ratio = (1 + e * cf) / eta**2  # a/r
    cos_0, cos_1, cos_3 = ca.cos(2 * w + 2 * f), ca.cos(2 * w + f), ca.cos(2 * w + 3 * f)
    sin_0, sin_1, sin_3 = ca.sin(2 * w + 2 * f), ca.sin(2 * w + f), ca.sin(2 * w + 3 * f)
    waves = 3 * sin_0 + 3 * e * sin_1 + e * sin_3
    long_period = 1 - 11 * c2 - 40 * c2**2 / k
    sin_2w = ca.sin(2 * w)

    da = a * g2 * ((3 * c2 - 1) * (ratio**3 - 1 / eta**3) + 3 * s2 * ratio**3 * cos_0)
    de_long = g / 8 * e * eta**2 * long_period * ca.cos(2 * w)
    power = 3 * cf + 3 * e * cf**2 + e**2 * cf**3
    de = de_long + eta**2 / 2 * (
        g2 / eta**6 * ((3 * c2 - 1) * (e * eta + e / (1 + eta) + power) + 3 * s2 * (e + power) * cos_0)
        - g * s2 * (3 * cos_1 + cos_3)
    )
    di = -e * de_long / (eta**2 * ca.tan(i)) + g / 2 * c * ca.sqrt(s2) * (
        3 * cos_0 + 3 * e * cos_1 + e * cos_3
    )
    node_long = -g / 8 * e**2 * c * (11 + 80 * c2 / k + 200 * c2**2 / k**2) * sin_2w
    draan = node_long - g / 2 * c * (6 * centre - waves)
    apse_long = g / 8 * eta**3 * long_period - g / 16 * (
        2 + e**2 - 11 * (2 + 3 * e**2) * c2 - 40 * (2 + 5 * e**2) * c2**2 / k - 400 * e**2 * c2**3 / k**2
    )
    longitude = (
        M + w + raan + apse_long * sin_2w + g / 4 * (-6 * k * centre + (3 - 5 * c2) * waves) + draan
    )
    square = (ratio * eta) ** 2 + ratio
    e_dM = g / 8 * e * eta**3 * long_period * sin_2w - g / 4 * eta**3 * (
        2 * (3 * c2 - 1) * (square + 1) * ca.sin(f)
        + 3 * s2 * ((1 - square) * sin_1 + (square + 1 / 3) * sin_3)
    )

    # Lyddane: e and M together, i and Ω together, so that neither e = 0 nor i = 0 divides.
    e_sin_M = (e + de) * ca.sin(M) + e_dM * ca.cos(M)
    e_cos_M = (e + de) * ca.cos(M) - e_dM * ca.sin(M)
    M_2 = ca.atan2(e_sin_M, e_cos_M)
    tilt, turn = ca.sin(i / 2) + ca.cos(i / 2) * di / 2, ca.sin(i / 2) * draan
    i_sin = tilt * ca.sin(raan) + turn * ca.cos(raan)
    i_cos = tilt * ca.cos(raan) - turn * ca.sin(raan)
    raan_2 = ca.atan2(i_sin, i_cos)
    e_2, w_2 = ca.sqrt(e_sin_M**2 + e_cos_M**2), longitude - M_2 - raan_2
    osculating = ca.vertcat(
        a + da,
        M_2 + w_2,
        e_2 * ca.cos(w_2),
        e_2 * ca.sin(w_2),
        2 * ca.asin(ca.sqrt(i_sin**2 + i_cos**2)),
        raan_2,
    )
    arguments = {"mean_qns": mean, "mu_radius_j2": earth}
    return dense("brouwer_lyddane", arguments, {"osculating_qns": osculating})


BROUWER_LYDDANE = Rows(_osculating)
"""casadi Function (mean qns, (μ, Rₑ, J₂)) → osculating qns; not at i = 0."""
