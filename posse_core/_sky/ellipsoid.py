"""Intersections of rays with the Earth's ellipsoid, in ECEF axes, metres, float64."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import WGS84_FLATTENING, Constants

SEMI_AXES_M: FloatArray = Constants().earth_radius_m * np.array([1.0, 1.0, 1.0 - WGS84_FLATTENING])
"""(3,) WGS 84 semi-axes along ECEF x, y, z."""
SEMI_AXES_M.setflags(write=False)


def entry_distance_m(
    origin_m: FloatArray, directions: FloatArray, semi_axes_m: FloatArray = SEMI_AXES_M
) -> FloatArray:
    """Distance along rays to the first intersection with an ellipsoid about the origin of coordinates.

    Args:
        origin_m: (3,) origin of the rays, outside the ellipsoid.
        directions: (..., 3) unit vectors.
        semi_axes_m: (3,).

    Returns:
        (...) distance in m, NaN where the ray misses.
    """
    o = origin_m / semi_axes_m
    d = directions / semi_axes_m
    dd = np.sum(d * d, axis=-1)
    od = d @ o
    discriminant = od * od - dd * (o @ o - 1.0)
    ahead = (discriminant >= 0) & (od < 0)
    root = np.sqrt(np.where(ahead, discriminant, np.nan))
    # (c / (−od + root)) is the nearer root without the cancellation of (−od − root) / dd.
    return np.asarray((o @ o - 1.0) / (root - od))
