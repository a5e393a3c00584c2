"""The facets of a spacecraft that have a temperature each, and what each of them sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from posse_core._arrays import AnyArray, FloatArray, IntArray
from posse_core._frames import R_with_z, unit
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles, dot
from posse_core._sensors.thermal.bisection import Bisection

SHEET_OPENNESS = 0.05
"""A facet whose back sees the sky by more than this is a sheet and radiates from both sides; the back of
any other facet is inside a body and insulated."""
_MOST_RAYS = 8_000_000
"""Rays in all by which the facets' views of the sky are found."""
_RAYS = (16, 256)
"""Smallest and largest number of them for each side of a facet."""
_KEPT_BYTES = 64_000_000
"""Memory for shadows that are kept."""
_SUN_STEPS = 60
"""Lattice steps per radian of the Sun's directions whose shadows are kept."""
_CHUNK = 1 << 18
_POINTS = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
"""Shares of the corners in the four points of a facet."""


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles divided into facets of about one size.

    Sides 0 … N−1 are the facets' fronts, by the order of the corners, and sides N … 2N−1 their backs.
    Vectors have the component first.

    Attributes:
        tracer: of the spacecraft; positions are relative to its ``triangles.centre_body_m``.
        bisection: of its triangles; the leaves are the facets.
    """

    tracer: Tracer
    bisection: Bisection

    @classmethod
    def of(cls, tracer: Tracer, longest_m: float) -> Facets:
        """Divide triangles until no edge is longer than ``longest_m``."""
        return cls(tracer, Bisection.of(tracer.triangles.corners_m, longest_m))

    @property
    def triangles(self) -> Triangles:
        """The undivided triangles."""
        return self.tracer.triangles

    @property
    def triangle(self) -> IntArray:
        """(N,) the triangle of each facet."""
        return self.bisection.leaf_triangle

    @property
    def count(self) -> int:
        """N, the number of facets."""
        return len(self.triangle)

    @cached_property
    def centre_m(self) -> FloatArray:
        """(3, N) centroids."""
        return np.ascontiguousarray(self.bisection.leaf_corners_m.mean(axis=1).T)

    @cached_property
    def area_m2(self) -> FloatArray:
        """(N,) areas."""
        a, b, c = np.moveaxis(self.bisection.leaf_corners_m, 1, 0)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    @cached_property
    def triangle_of_face(self) -> IntArray:
        """Triangle by the index of a face, counted through all parts; −1 for a face without area."""
        triangle = np.full(self.triangles.face[-1] + 1, -1)
        triangle[self.triangles.face] = np.arange(len(self.triangles.face))
        return triangle

    @cached_property
    def normal(self) -> FloatArray:
        """(3, N) unit normals on the fronts."""
        return np.take(self.triangles.normal, self.triangle, axis=1)

    @cached_property
    def normals(self) -> tuple[FloatArray, IntArray]:
        """(3, M) the different normals of the fronts, and (N,) which of them is whose."""
        several, which = np.unique(self.triangles.normal, axis=1, return_inverse=True)
        return several, which.reshape(-1)[self.triangle]

    @cached_property
    def part_id(self) -> IntArray:
        """(N,) index of each facet's part."""
        return self.triangles.part_id[self.triangle]

    @cached_property
    def points_m(self) -> FloatArray:
        """(3, N, 4) points on each facet: the centroids of the four triangles of half its size that it
        consists of."""
        return np.asarray(np.einsum("nci,pc->inp", self.bisection.leaf_corners_m, _POINTS))

    def lit(self, direction: FloatArray) -> FloatArray:
        """(2N,) share of the four points of each side on which the Sun in a direction (3,) shines. The
        Sun is a point: shadows have no penumbra."""
        sunny = np.flatnonzero(dot(self.normal, direction) != 0)
        facing = np.where(dot(self.normal[:, sunny], direction) > 0, 1.0, -1.0)
        normal = np.repeat(facing * self.normal[:, sunny], len(_POINTS), axis=1)
        points_m = self.points_m[:, sunny].reshape(3, -1)
        shadowed = self.tracer.shadowed(points_m, normal, direction[:, None])
        lit = np.zeros(2 * self.count)
        shares = 1 - shadowed.reshape(-1, len(_POINTS)).mean(axis=1)
        lit[sunny + np.where(facing > 0, 0, self.count)] = shares
        return lit

    def lit_about(self, direction: FloatArray) -> FloatArray:
        """:meth:`lit` for the nearest direction of a lattice, which is 0.8° off at most.

        Directions of the lattice are kept, and each is computed from itself alone, so what is kept
        changes no result. The angle of incidence is not part of it.
        """
        node = tuple(np.rint(_SUN_STEPS * direction).astype(int).tolist())
        return self._kept(node) / len(_POINTS)

    @cached_property
    def _kept(self) -> Callable[[tuple[int, ...]], AnyArray]:
        """(2N,) uint8 number of sunlit points by node of the lattice."""

        def points_lit(node: tuple[int, ...]) -> AnyArray:
            return np.rint(len(_POINTS) * self.lit(unit(np.array(node, float)))).astype(np.uint8)

        return lru_cache(max(16, _KEPT_BYTES // (2 * self.count)))(points_lit)

    @cached_property
    def openness(self) -> FloatArray:
        """(2N,) share of the radiation of each side that leaves the spacecraft: 1 if no facet is in
        view.

        Rays from the four points in turn are spread by Lambert's law, the same for all sides about their
        normals.
        """
        rays = int(np.clip(_MOST_RAYS // (2 * self.count), *_RAYS))
        index = np.arange(rays)
        azimuth = 2 * np.pi * np.mod(index / ((1 + np.sqrt(5)) / 2), 1)
        sine = np.sqrt((index + 0.5) / rays)
        own = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.sqrt(1 - sine**2)])
        open_share = np.empty(2 * self.count)
        step = max(1, _CHUNK // rays)
        for side, sign in enumerate((1.0, -1.0)):
            for start in range(0, self.count, step):
                part = slice(start, start + step)
                normal = sign * self.normal[:, part]
                axes = np.moveaxis(R_with_z(normal.T), 0, -1)
                # (3, n, rays)
                rays_body = np.stack([dot(row[:, :, None], own[:, None, :]) for row in axes])
                starts_m = self.points_m[:, part, index % len(_POINTS)].reshape(3, -1)
                normals = np.repeat(normal, rays, axis=1)
                hidden = self.tracer.shadowed(starts_m, normals, rays_body.reshape(3, -1))
                shares = 1 - hidden.reshape(-1, rays).mean(axis=1)
                first = side * self.count + start
                open_share[first : first + len(shares)] = shares
        return open_share

    def behind(self, thin_m: float) -> IntArray:
        """(N,) the side through which each facet also radiates, beside its front; −1 for none.

        It is the front of the facet on the other side of a wall, where the part is not thicker than
        ``thin_m`` behind the facet's centre; or the facet's own back, where that sees the sky.
        """
        other = self._across(thin_m)
        sheet = self.openness[self.count :] > SHEET_OPENNESS
        back = np.arange(self.count, 2 * self.count)
        return np.where(other >= 0, other, np.where(sheet, back, -1))

    def _across(self, thin_m: float) -> IntArray:
        """(N,) the facet opposite of each behind a thin wall of the same part, −1 for none."""
        lift_m = 1e-6 * self.triangles.size_m
        triangle, distance_m = self.tracer.first(self.centre_m - lift_m * self.normal, -self.normal, 0.0)
        hit = np.flatnonzero((triangle >= 0) & (distance_m <= thin_m))
        normal = self.normal[:, hit]
        other = triangle[hit]
        same_part = self.triangles.part_id[other] == self.part_id[hit]
        opposed = dot(np.take(self.triangles.normal, other, axis=1), normal) < 0
        hit, other = hit[same_part & opposed], other[same_part & opposed]
        point_m = self.centre_m[:, hit] - (lift_m + distance_m[hit]) * self.normal[:, hit]
        across = np.full(self.count, -1)
        across[hit] = self.bisection.at(other, point_m)
        return across
