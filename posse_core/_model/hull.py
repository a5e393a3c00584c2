"""Convex hulls of points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from posse_core._arrays import FloatArray


def hull_points(points_m: FloatArray) -> FloatArray:
    """Return those of points (N, 3) on their convex hull (H, 3): no other one is the farthest from any
    point or in any direction.

    ("QJ" makes the hull of flat sets possible.)
    """
    if len(points_m) < 5:
        return points_m
    on_hull = ConvexHull(points_m, qhull_options="QJ").vertices
    return np.asarray(points_m[on_hull])
