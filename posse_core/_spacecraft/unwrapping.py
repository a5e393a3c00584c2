"""Texture coordinates for parts that have none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.spacecraft import Part
from posse_core._spacecraft.corners import edges, shared
from posse_core._spacecraft.raw import CREASE_RAD

_SAME = 1e-6
"""Share of a part's size within which two corners are one point."""


def is_unwrapped(part: Part) -> bool:
    """Whether a part has texture coordinates."""
    return bool(np.ptp(part.uv, axis=0).any())


def unwrapped(part: Part, tile_m: float, rng: np.random.Generator) -> Part:
    """Return the part with texture coordinates: each triangle is seen along that axis of its part which
    it faces most. Each side, which ends at its edges, lies elsewhere in the texture.

    Triangles of different sides share no vertex; shape and normals stay as they are.

    Args:
        part: without texture coordinates.
        tile_m: side of the square that the texture covers, m.
        rng: of the places of the sides.
    """
    corners_m = part.vertices_body_m[part.faces]
    a, b, c = np.moveaxis(corners_m, 1, 0)
    facing = np.cross(b - a, c - a)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), np.finfo(float).tiny)
    axis = np.abs(facing).argmax(axis=1)
    side = _sides(corners_m, facing)
    offsets = rng.uniform(size=(int(side.max()) + 1, 3, 2))
    across = np.array([(1, 2), (2, 0), (0, 1)])[axis]
    flat_m = np.take_along_axis(corners_m, across[:, None, :], axis=2)
    uv = (flat_m / tile_m + offsets[side, axis][:, None]).reshape(-1, 2)
    places_m = corners_m.reshape(-1, 3)
    normals = part.normals_body[part.faces].reshape(-1, 3)
    kept, faces = shared(places_m, normals.astype(np.float64), uv)
    return replace(
        part,
        vertices_body_m=places_m[kept],
        faces=faces.astype(np.int32),
        normals_body=normals[kept],
        uv=uv[kept].astype(np.float32),
    )


def _sides(corners_m: FloatArray, normals: FloatArray) -> IntArray:
    """(T,) number of the side of each triangle (T, 3 corners, 3) with its unit normal (T, 3)."""
    count = len(corners_m)
    step_m = max(_SAME * float(np.ptp(corners_m, axis=(0, 1)).max()), 1e-12)
    edge = edges(np.rint(corners_m / step_m).astype(np.int64)).reshape(-1)
    order = np.argsort(edge, kind="stable")
    sorted_edges = edge[order]
    triangle = np.repeat(np.arange(count), 3)[order]
    # Triangles at one edge are neighbours in this order.
    meet = sorted_edges[1:] == sorted_edges[:-1]
    one, other = triangle[:-1][meet], triangle[1:][meet]
    smooth = np.sum(normals[one] * normals[other], axis=1) > np.cos(CREASE_RAD)
    one, other = one[smooth], other[smooth]
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
