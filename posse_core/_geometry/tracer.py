"""Rays on a spacecraft: Embree names the triangle, float64 says where.

Embree computes in single precision, so all that is taken from it is which triangle a ray meets first.
The point on the triangle's plane is computed in float64. Where that point lies outside the triangle
(within Embree's rounding of an edge, or far along a face that the ray grazes), the ray is settled by
trying every triangle in float64.
"""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray
from posse_core._geometry.triangles import Triangles

_LIFT_SHARE = 1e-6
"""How far shadow rays start above the surface, over the craft's size: thirty times the rounding."""


class Tracer:
    """Embree's tree over the triangles, built once; positions are body axes minus their centre."""

    def __init__(self, triangles: Triangles) -> None:
        self.triangles = triangles
        self._embree = EmbreeScene(robust=True)
        TriangleMesh(self._embree, triangles.corners_m.astype(np.float32))

    def first(
        self, origin_m: FloatArray, directions: FloatArray, start: float
    ) -> tuple[IntArray, FloatArray]:
        """First triangle along each ray x = origin + t d.

        Args:
            origin_m: (3,).
            directions: (3, N), of any length.
            start: t from which on the craft may be met: in front of all of it, and near it, so that
                single precision sees numbers of the craft's size only.

        Returns:
            (N,) triangle, −1 for none, and (N,) t, infinite for none.
        """
        starts_m = origin_m[:, None] + start * directions
        triangle = self._embree.run(_single(starts_m), _single(directions)).astype(np.int64)
        t = np.full(len(triangle), np.inf)
        hit = np.flatnonzero(triangle >= 0)
        aimed = np.take(directions, hit, axis=1)
        t[hit], inside = self.triangles.meet(triangle[hit], origin_m, aimed)
        doubtful = hit[~inside]
        if len(doubtful):
            aimed = directions[:, doubtful]
            triangle[doubtful], t[doubtful] = self.triangles.first_hit(origin_m, aimed)
        return triangle, t

    def shadowed(self, point_m: FloatArray, normal: FloatArray, direction: FloatArray) -> BoolArray:
        """Whether a triangle lies between surface points and an infinitely far light.

        Args:
            point_m: (3, N) on the surface.
            normal: (3, N) unit, on the side of the surface that is looked at.
            direction: (3,) to the light.
        """
        starts_m = point_m + _LIFT_SHARE * self.triangles.size_m * normal
        # Embree's wrapper takes one direction for all rays.
        blocker = self._embree.run(_single(starts_m), _single(direction[:, None]), query="OCCLUDED")
        return np.asarray(blocker >= 0)


def _single(vectors: FloatArray) -> Float32Array:
    """(3, N) float64 → (N, 3) float32, as Embree's wrapper takes them."""
    return np.ascontiguousarray(vectors.T, dtype=np.float32)
