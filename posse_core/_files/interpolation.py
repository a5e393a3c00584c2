"""Interpolation of recorded paths by polynomials, as ephemeris messages ask for (CCSDS 502.0-B-3)."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from posse_core._arrays import FloatArray

Method = Literal["HERMITE", "LAGRANGE", "LINEAR"]
SAME_INSTANT_S: Final = 1e-6
"""Times that are nearer to each other than this are one instant."""


def path_at(
    t_s: FloatArray, r_m: FloatArray, v_m_s: FloatArray, at_s: FloatArray, method: Method, degree: int
) -> tuple[FloatArray, FloatArray]:
    """Interpolate a path; at its own instants the result is its own states.

    Args:
        t_s: (N,) increasing times.
        r_m: (N, 3) positions.
        v_m_s: (N, 3) their derivatives.
        at_s: (F,) times within those of the path.
        method: ``HERMITE``: the polynomial through positions and velocities, and its derivative.
            ``LAGRANGE``: polynomials through positions, and others through velocities. ``LINEAR``: the
            same of degree 1.
        degree: of the polynomials; lower where the path has too few points.

    Returns:
        (F, 3) positions and (F, 3) velocities.
    """
    from scipy.interpolate import BarycentricInterpolator, KroghInterpolator  # slow to import

    points = (degree + 1) // 2 if method == "HERMITE" else degree + 1
    points = min(max(points, 2), len(t_s))
    after = np.clip(np.searchsorted(t_s, at_s), 1, len(t_s) - 1)
    nearest = after - (at_s - t_s[after - 1] < t_s[after] - at_s) if len(t_s) > 1 else 0 * after
    r, v = r_m[nearest], v_m_s[nearest]
    between = np.abs(t_s[nearest] - at_s) > SAME_INSTANT_S
    first = np.clip(np.searchsorted(t_s, at_s) - points // 2, 0, len(t_s) - points)
    for start in np.unique(first[between]):
        chosen = between & (first == start)
        window = slice(start, start + points)
        middle_s, half_s = t_s[window].mean(), np.ptp(t_s[window]) / 2
        x, at = (t_s[window] - middle_s) / half_s, (at_s[chosen] - middle_s) / half_s
        if method == "HERMITE":
            rows = np.stack([r_m[window], v_m_s[window] * half_s], axis=1).reshape(-1, 3)
            curve = KroghInterpolator(np.repeat(x, 2), rows)
            r[chosen], v[chosen] = curve(at), curve.derivative(at) / half_s
        else:
            both = BarycentricInterpolator(x, np.hstack([r_m[window], v_m_s[window]]))(at)
            r[chosen], v[chosen] = both[:, :3], both[:, 3:]
    return r, v
