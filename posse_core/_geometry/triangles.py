"""The parts of a spacecraft as one list of triangles, and their intersections with rays in float64.

In this package arrays of vectors have the component first, (3, N), because numpy is several times faster
that way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._model.spacecraft import Spacecraft

_EDGE_OVERSHOOT_SHARE = 1e-9
"""How far outside its edges a triangle still counts as hit, as a share of the spacecraft's size; it
covers rounding errors only."""
_BLOCK = 1 << 18
"""Number of ray-triangle pairs that the exhaustive search holds at once."""


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Σ a b over the first axis, of length 3. It is computed elementwise, so that the result does not
    depend on the BLAS library."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a × b over the first axis, of length 3."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotated(R: FloatArray, x: FloatArray) -> FloatArray:
    """R x for (3, 3), or (3, 3, N), and (3, N) → (3, N), elementwise as in :func:`dot`."""
    return np.stack([dot(row, x) for row in R])


@dataclass(frozen=True)
class Triangles:
    """T triangles of nonzero area in body axes. Positions are relative to ``centre_body_m``, to keep
    rounding errors small.

    Attributes:
        centre_body_m: (3,) centre of the spacecraft's axis-aligned bounding box.
        size_m: the longest side of that box.
        corners_m: (T, 3 corners, 3).
        normal: (3, T) unit normals, by the order of the corners.
        plane_m: (T,) a point x is on the triangle's plane if normal · x = plane_m.
        inward: (3 edges, 3, T) unit vectors in the triangle's plane, normal to each edge, pointing
            inside.
        edge_m: (3 edges, T) a point x is inside an edge if inward · x ≥ edge_m.
        part_id: (T,) int16 index in ``spacecraft.parts``.
        face: (T,) index among the faces of all parts, counted through them in order.
    """

    centre_body_m: FloatArray
    size_m: float
    corners_m: FloatArray
    normal: FloatArray
    plane_m: FloatArray
    inward: FloatArray
    edge_m: FloatArray
    part_id: IntArray
    face: IntArray

    @classmethod
    def of(cls, spacecraft: Spacecraft) -> Triangles:
        """Merge the parts of a spacecraft."""
        parts = spacecraft.parts
        corners_body_m = np.concatenate([part.vertices_body_m[part.faces] for part in parts])
        faces = [len(part.faces) for part in parts]
        part_id = np.repeat(np.arange(len(parts), dtype=np.int16), faces)
        return cls.of_corners(corners_body_m, part_id, spacecraft.bounds_body_m)

    @classmethod
    def of_corners(
        cls, corners_body_m: FloatArray, part_id: IntArray, bounds_body_m: FloatArray
    ) -> Triangles:
        """Prepare (T, 3 corners, 3) triangles with their parts (T,), within the (2, 3) bounds.

        Triangles without area are left out, because no ray can hit them.
        """
        low, high = bounds_body_m
        centre = (low + high) / 2
        corners = corners_body_m - centre
        sides = np.roll(corners, -1, axis=1) - corners
        normal = np.cross(sides[:, 0], sides[:, 1])
        area = np.linalg.norm(normal, axis=-1)
        length = np.linalg.norm(sides, axis=-1)
        whole = area > 1e-12 * length.max(axis=1) ** 2
        corners, part_id = corners[whole], part_id[whole]
        normal = normal[whole] / area[whole, None]
        inward = np.cross(normal[:, None, :], sides[whole] / length[whole, :, None])
        component_first = np.ascontiguousarray(np.moveaxis(inward, 0, -1))
        return cls(
            centre_body_m=centre,
            size_m=float((high - low).max()),
            corners_m=corners,
            normal=np.ascontiguousarray(normal.T),
            plane_m=np.sum(normal * corners[:, 0], axis=-1),
            inward=component_first,
            edge_m=np.ascontiguousarray(np.sum(inward * corners, axis=-1).T),
            part_id=part_id,
            face=np.flatnonzero(whole),
        )

    def meet(
        self, triangle: IntArray, origin_m: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Intersect rays x = origin + t d with the planes of triangles.

        Args:
            triangle: (N,) index of the triangle of each ray.
            origin_m: (3, 1) origin of all rays, or (3, N); body axes, relative to the centre.
            directions: (3, N), of any length.

        Returns:
            (N,) t, and (N,) whether t > 0 and the point is inside the triangle.
        """
        normal = np.take(self.normal, triangle, axis=1)
        height_m = self.plane_m[triangle] - dot(normal, origin_m)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = height_m / dot(normal, directions)
            point_m = origin_m + t * directions
            inside = t > 0
            for inward, edge_m in zip(self.inward, self.edge_m, strict=True):
                across_m = dot(np.take(inward, triangle, axis=1), point_m)
                inside &= across_m >= np.take(edge_m, triangle) - _EDGE_OVERSHOOT_SHARE * self.size_m
        return t, inside

    def first_hit(self, origin_m: FloatArray, directions: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find the first hit by trying every triangle, for rays that single precision cannot decide.

        Args:
            origin_m: (3, 1) origin of all rays, or (3, N); body axes, relative to the centre.
            directions: (3, N), of any length.

        Returns:
            (N,) index of the first triangle hit, −1 for none, and (N,) its t, infinite for none. Of
            several triangles at the same t, the one with the lowest index is returned.
        """
        count = len(self.plane_m)
        first = np.full(directions.shape[1], -1, dtype=np.int64)
        nearest = np.full(directions.shape[1], np.inf)
        origins_m = np.broadcast_to(origin_m, directions.shape)
        step = max(1, _BLOCK // count)
        for start in range(0, len(first), step):
            o, d = (each[:, start : start + step] for each in (origins_m, directions))
            rays = d.shape[1]
            triangle = np.tile(np.arange(count), rays)
            t, inside = self.meet(triangle, np.repeat(o, count, axis=1), np.repeat(d, count, axis=1))
            t = np.where(inside, t, np.inf).reshape(rays, count)
            best = t.argmin(axis=1)
            nearest[start : start + step] = t[np.arange(rays), best]
            first[start : start + step] = best
        return np.where(np.isfinite(nearest), first, -1), nearest
