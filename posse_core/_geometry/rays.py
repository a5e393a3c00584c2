"""Single rays onto the spacecraft, each from an origin and at an instant of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._frames import turned, unit
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import dot, rotated
from posse_core._model.ray_hits import RayHits
from posse_core._model.scene import CraftState

_BLOCK = 1 << 13
"""Rays that are cast at once; their arrays fit into the processor's cache."""


def cast_rays(
    tracer: Tracer,
    craft: CraftState,
    directions: FloatArray,
    origin_m: ArrayLike,
    after_s: ArrayLike,
) -> RayHits:
    """Find what each ray hits first; see :meth:`posse_core.RayCaster.rays`."""
    directions = unit(directions)
    origins_m = np.broadcast_to(np.asarray(origin_m, dtype=np.float64), directions.shape)
    times_s = np.asarray(after_s, dtype=np.float64)
    shared = None if times_s.ndim else _Placed.at(craft.after(float(times_s)))
    blocks = []
    for block in _blocks(len(directions)):
        where = shared or _Placed.each(craft, times_s[block])
        blocks.append(_cast(tracer, where, directions[block].T, origins_m[block].T))
    distance_m, triangle, normal, point_m, lit = (
        np.concatenate(column, axis=-1) for column in zip(*blocks, strict=True)
    )
    # One row per triangle, and a last one (index −1) for rays that hit none.
    triangles = tracer.triangles
    return RayHits(
        distance_m=distance_m,
        triangle=np.append(triangles.face, -1)[triangle],
        part_id=np.append(triangles.part_id, np.int16(-1))[triangle],
        normal=np.ascontiguousarray(normal.T),
        point_body_m=np.ascontiguousarray(point_m.T) + triangles.centre_body_m,
        lit=lit,
    )


@dataclass(frozen=True)
class _Placed:
    """Where the spacecraft and the Sun are, at one instant for all rays or at one for each.

    Attributes:
        R_cam_from_body: (3, 3) or (3, 3, N).
        t_body_cam_m: (3, 1) or (3, N).
        sun_direction_body: (3, 1) or (3, N).
    """

    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    sun_direction_body: FloatArray

    @classmethod
    def at(cls, craft: CraftState) -> _Placed:
        return cls(craft.R_cam_from_body, craft.t_body_cam_m[:, None], craft.sun_direction_body[:, None])

    @classmethod
    def each(cls, craft: CraftState, after_s: FloatArray) -> _Placed:
        R, t = craft.poses_after(after_s)
        # The Sun stands still, and the body turns.
        sun = turned(craft.sun_direction_body, -craft.rates.omega_body_rad_s, after_s)
        return cls(np.moveaxis(R, 0, -1), t.T, np.broadcast_to(sun, t.shape).T)


def _cast(
    tracer: Tracer, placed: _Placed, directions: FloatArray, origins_m: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray, BoolArray]:
    """Distance (N,), index of the triangle (N,), normal (3, N) in the ray's axes, point (3, N) in body
    axes relative to the centre, and ``lit`` (N,), of rays (3, N)."""
    triangles = tracer.triangles
    R = placed.R_cam_from_body
    R_body_from_cam = np.swapaxes(R, 0, 1)
    origins = rotated(R_body_from_cam, origins_m - placed.t_body_cam_m)
    origins = origins - triangles.centre_body_m[:, None]
    rays = rotated(R_body_from_cam, directions)
    # No part of the box around the spacecraft is further from its centre than its longest side.
    start_m = np.maximum(0.0, -dot(origins, rays) - triangles.size_m)
    triangle, distance_m = tracer.first(origins, rays, start_m)
    found = np.flatnonzero(triangle >= 0)

    rays = np.take(rays, found, axis=1)
    normals = np.take(triangles.normal, triangle[found], axis=1)
    normals = np.where(dot(normals, rays) > 0, -normals, normals)
    points = np.take(origins, found, axis=1) + distance_m[found] * rays
    normal, point_m = np.full((2, *origins.shape), np.nan)
    normal[:, found] = rotated(R if R.ndim == 2 else R[..., found], normals)
    point_m[:, found] = points

    lit = np.zeros(len(triangle), dtype=np.bool_)
    sun = np.broadcast_to(placed.sun_direction_body, origins.shape)[:, found]
    sunny = np.flatnonzero(dot(normals, sun) > 0)
    shadowed = tracer.shadowed(points[:, sunny], normals[:, sunny], sun[:, sunny])
    lit[found[sunny]] = ~shadowed
    return distance_m, triangle, normal, point_m, lit


def _blocks(count: int) -> Iterator[slice]:
    """Slices of at most :data:`_BLOCK` rays; one that is empty if there are none."""
    for start in range(0, max(count, 1), _BLOCK):
        yield slice(start, start + _BLOCK)
