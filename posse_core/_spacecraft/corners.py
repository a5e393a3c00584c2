"""Vertices and edges that triangles share."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray

_STEP = 1e-6
"""Normals and texture coordinates that differ by less are the same."""


def shared(places: FloatArray, normals: FloatArray, uv: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which corners of triangles are one vertex: at exactly one place, with one normal and one
    pair of texture coordinates.

    Args:
        places: (N, 3) of the corners, three for each triangle.
        normals: (N, 3) unit vectors.
        uv: (N, 2).

    Returns:
        (V,) a corner that is each vertex, in the order of the corners; and (N / 3, 3) the vertices of
        each triangle.
    """
    rows = np.column_stack([places, np.rint(normals / _STEP), np.rint(uv / _STEP)])
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[number.reshape(-1)].reshape(-1, 3)


def edges(places: FloatArray | IntArray) -> IntArray:
    """(T, 3) the same number for the same edge, from corner k to the next, in (T, 3, 3) triangles."""
    _, point = np.unique(places.reshape(-1, 3), axis=0, return_inverse=True)
    start = point.reshape(-1, 3)
    ends = np.sort(np.stack([start, np.roll(start, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    return np.asarray(edge.reshape(-1, 3))
