"""Kepler's equation in a form without a singularity at e = 0."""

from __future__ import annotations

from typing import Any

import casadi as ca

from posse_core._arrays import FloatArray
from posse_core._dynamics.rows import Rows, dense

CORRECTIONS = 6
"""Number of fifth-order corrections; five reach rounding at e = 0.9999 from the starting value below."""


def corrections_for(e: float) -> int:
    """Number of corrections that reach rounding at eccentricities up to e, for any mean anomaly.

    The starting value's error is 6e-6 at e = 0.1, and 1e-5 after one correction at e = 0.9. The next
    correction reduces it to the order of its fifth power, which is below rounding.
    """
    if e <= 0.1:
        return 1
    return 2 if e <= 0.9 else CORRECTIONS


def eccentric_longitude(longitude: Any, ex: Any, ey: Any, corrections: int = CORRECTIONS) -> Any:
    """Casadi expression of F in l = F − ex sin F + ey cos F, the generalised Kepler equation.

    F is E + ϖ for the mean longitude l = M + ϖ and the eccentricity vector e (cos ϖ, sin ϖ), for
    any ϖ that all three share; e < 1. F is smooth at e = 0, where E and ϖ alone are undefined.

    Starting value: Smith (1979), Celestial Mechanics 19, 163, eq. 2. Corrections: Householder's of
    fourth order (Danby & Burkardt 1983, Celestial Mechanics 31, 95). Their number is fixed so that
    casadi can differentiate the expression; at the root the last correction alone carries the
    derivative.
    """
    s, c = ca.sin(longitude), ca.cos(longitude)
    F = longitude + (ex * s - ey * c) / ca.sqrt(1 - 2 * (ex * c + ey * s) + ex**2 + ey**2)
    for _ in range(corrections):
        s, c = ca.sin(F), ca.cos(F)
        f2 = ex * s - ey * c
        f3 = ex * c + ey * s
        f = F - f2 - longitude
        f1 = 1 - f3
        d = -f / (f1 - f * f2 / (2 * f1))
        d = -f / (f1 + d * f2 / 2 + d**2 * f3 / 6)
        d = -f / (f1 + d * f2 / 2 + d**2 * f3 / 6 - d**3 * f2 / 24)
        F = F + d
    return F


def _function() -> Any:
    l, ex, ey = (ca.SX.sym(name) for name in ("longitude_rad", "ex", "ey"))
    arguments = {"longitude_rad": l, "ex": ex, "ey": ey}
    return dense(
        "eccentric_longitude",
        arguments,
        {"eccentric_longitude_rad": eccentric_longitude(l, ex, ey)},
    )


ECCENTRIC_LONGITUDE = Rows(_function)
"""casadi Function (mean longitude, ex, ey) → eccentric longitude, rad."""


def eccentric_longitude_rad(
    longitude_rad: FloatArray | float, ex: FloatArray | float, ey: FloatArray | float
) -> FloatArray:
    """Solve Kepler's equation; arguments broadcast, e < 1. See :func:`eccentric_longitude`.

    With ey = 0 it is the classical equation: M, e → E.
    """
    result: FloatArray = ECCENTRIC_LONGITUDE(longitude_rad, ex, ey)
    return result
