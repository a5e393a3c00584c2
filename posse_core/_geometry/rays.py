"""Single rays onto the bodies of a scene, each from an origin and at an instant of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._frames import turned, unit
from posse_core._geometry.solids import GRAZING, Placed, Solid, placed_at, shadowed
from posse_core._geometry.triangles import dot
from posse_core._model.craft_state import CraftState
from posse_core._model.ray_hits import RayHits

_BLOCK = 1 << 13
"""Rays that are cast at once; their arrays fit into the processor's cache."""


def cast_rays(
    solids: Sequence[Solid],
    craft: CraftState,
    directions: FloatArray,
    origin_m: ArrayLike,
    after_s: ArrayLike,
) -> RayHits:
    """Find what each ray hits first; see :meth:`posse_core.RayCaster.rays`."""
    directions = unit(directions)
    origins_m = np.broadcast_to(np.asarray(origin_m, dtype=np.float64), directions.shape)
    times_s = np.asarray(after_s, dtype=np.float64)
    shared = None
    if not times_s.ndim:
        then = craft.after(float(times_s))
        shared = _Instant(placed_at(solids, then.link_poses()), then.sun_direction_cam[:, None])
    blocks = []
    for block in _blocks(len(directions)):
        where = shared or _Instant.each(solids, craft, times_s[block])
        blocks.append(_cast(where, directions[block].T, origins_m[block].T))
    distance_m, triangle, part_id, normal, point_m, lit = (
        np.concatenate(column, axis=-1) for column in zip(*blocks, strict=True)
    )
    return RayHits(
        distance_m=distance_m,
        triangle=triangle,
        part_id=part_id,
        normal=np.ascontiguousarray(normal.T),
        point_body_m=np.ascontiguousarray(point_m.T),
        lit=lit,
    )


@dataclass(frozen=True)
class _Instant:
    """Where the solids and the Sun are, at one instant for all rays or at one for each.

    Attributes:
        placed: the solids.
        sun_direction_cam: (3, 1) or (3, N) in the ray's axes.
    """

    placed: tuple[Placed, ...]
    sun_direction_cam: FloatArray

    @classmethod
    def each(cls, solids: Sequence[Solid], craft: CraftState, after_s: FloatArray) -> _Instant:
        placed = []
        for solid in solids:
            R, t_m = craft.bodies[solid.body].link_poses_after(solid.link, after_s)
            placed.append(Placed(solid, np.moveaxis(R, 0, -1), t_m.T))
        # The Sun stands still, and the camera turns.
        sun = turned(craft.sun_direction_cam, -craft.rates.omega_camera_rad_s, after_s)
        return cls(tuple(placed), np.broadcast_to(sun, (len(after_s), 3)).T)


def _cast(
    instant: _Instant, directions: FloatArray, origins_m: FloatArray
) -> tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray, BoolArray]:
    """Distance (N,), triangle (N,), part (N,), normal (3, N) in the ray's axes, point (3, N) in the axes
    of its link, and ``lit`` (N,), of rays (3, N)."""
    count = directions.shape[1]
    distance_m, owner = np.full(count, np.inf), np.full(count, -1)
    casts = []
    for number, placed in enumerate(instant.placed):
        triangles = placed.solid.tracer.triangles
        origins = placed.point_here(origins_m)
        rays = placed.direction_here(directions)
        # No part of the box around the solid is further from its centre than its longest side.
        start_m = np.maximum(0.0, -dot(origins, rays) - triangles.size_m)
        triangle, own_m = placed.solid.tracer.first(origins, rays, start_m)
        nearer = own_m < distance_m
        distance_m[nearer], owner[nearer] = own_m[nearer], number
        casts.append((triangle, origins, rays))
    face = np.full(count, -1, dtype=np.int32)
    part_id = np.full(count, -1, dtype=np.int16)
    normal, point_m = np.full((2, 3, count), np.nan)
    lit = np.zeros(count, dtype=np.bool_)
    for number, (placed, (triangle, origins, rays)) in enumerate(
        zip(instant.placed, casts, strict=True)
    ):
        found = np.flatnonzero(owner == number)
        hit = triangle[found]
        triangles = placed.solid.tracer.triangles
        face[found], part_id[found] = placed.solid.face[hit], placed.solid.part_id[hit]
        own_rays = np.take(rays, found, axis=1)
        normals = np.take(triangles.normal, hit, axis=1)
        normals = np.where(dot(normals, own_rays) > 0, -normals, normals)
        points = np.take(origins, found, axis=1) + distance_m[found] * own_rays
        normal[:, found] = placed.of_rays(found).direction_in_camera(normals)
        point_m[:, found] = points + triangles.centre_body_m[:, None]
        sun_cam = np.broadcast_to(instant.sun_direction_cam, normal.shape)[:, found]
        cosine = dot(normals, placed.of_rays(found).direction_here(sun_cam))
        sunny = np.flatnonzero(cosine > GRAZING)
        bright = found[sunny]
        dark = shadowed(
            [each.of_rays(bright) for each in instant.placed],
            number,
            points[:, sunny],
            normals[:, sunny],
            sun_cam[:, sunny],
        )
        lit[bright] = ~dark
    return distance_m, face, part_id, normal, point_m, lit


def _blocks(count: int) -> Iterator[slice]:
    """Slices of at most :data:`_BLOCK` rays; one that is empty if there are none."""
    for start in range(0, max(count, 1), _BLOCK):
        yield slice(start, start + _BLOCK)
