"""Ray tracing on a spacecraft: Embree finds the triangle, and float64 arithmetic computes the point.

Embree works in single precision, so it is only used to find the triangle that a ray hits first. The
point on the triangle's plane is computed in float64. If that point lies outside the triangle (by
Embree's rounding near an edge, or far away on a face that the ray grazes), every triangle is tried in
float64.
"""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from posse_core._arrays import BoolArray, Float32Array, FloatArray, IntArray
from posse_core._geometry.triangles import Triangles

_LIFT_SHARE = 1e-6
"""Height above the surface at which shadow rays start, as a share of the spacecraft's size: thirty times
the rounding error."""


class Tracer:
    """Embree's search tree over the triangles, built once. Positions are in body axes, relative to
    ``triangles.centre_body_m``."""

    def __init__(self, triangles: Triangles) -> None:
        self.triangles = triangles
        self._embree = EmbreeScene(robust=True)
        TriangleMesh(self._embree, triangles.corners_m.astype(np.float32))

    def first(
        self, origin_m: FloatArray, directions: FloatArray, start: float | FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Find the first triangle along each ray x = origin + t d.

        Args:
            origin_m: (3, 1) origin of all rays, or (3, N).
            directions: (3, N), of any length.
            start: t at which the search starts, of all rays or (N,). It must be in front of the whole
                spacecraft, and near it, so that single precision only handles numbers of the
                spacecraft's size.

        Returns:
            (N,) index of the triangle, −1 for none, and (N,) t, infinite for none.
        """
        starts_m = origin_m + start * directions
        triangle = self._embree.run(_single(starts_m), _single(directions)).astype(np.int64)
        t = np.full(len(triangle), np.inf)
        hit = np.flatnonzero(triangle >= 0)
        aimed = np.take(directions, hit, axis=1)
        t[hit], inside = self.triangles.meet(triangle[hit], _origins(origin_m, hit), aimed)
        doubtful = hit[~inside]
        if len(doubtful):
            aimed = directions[:, doubtful]
            triangle[doubtful], t[doubtful] = self.triangles.first_hit(
                _origins(origin_m, doubtful), aimed
            )
        return triangle, t

    def shadowed(self, point_m: FloatArray, normal: FloatArray, direction: FloatArray) -> BoolArray:
        """Whether a triangle lies between surface points and a light at infinity: (N,).

        Args:
            point_m: (3, N) points on the surface.
            normal: (3, N) unit normals, on the side of the surface that the camera sees.
            direction: (3, 1) vector to the light for all points, or (3, N).
        """
        return self.blocked(point_m + _LIFT_SHARE * self.triangles.size_m * normal, direction)

    def blocked(self, start_m: FloatArray, direction: FloatArray) -> BoolArray:
        """Whether rays meet a triangle: (N,), in single precision.

        Args:
            start_m: (3, N) where they begin.
            direction: (3, 1) of all rays, or (3, N).
        """
        # Embree's wrapper takes one direction for all rays, too.
        blocker = self._embree.run(_single(start_m), _single(direction), query="OCCLUDED")
        return np.asarray(blocker >= 0)


def _origins(origin_m: FloatArray, rays: IntArray) -> FloatArray:
    """The origins of some rays, by their index: (3, 1) of all, or (3, n)."""
    return origin_m if origin_m.shape[1] == 1 else np.take(origin_m, rays, axis=1)


def _single(vectors: FloatArray) -> Float32Array:
    """(3, N) float64 → (N, 3) float32, the layout of Embree's wrapper."""
    return np.ascontiguousarray(vectors.T, dtype=np.float32)
