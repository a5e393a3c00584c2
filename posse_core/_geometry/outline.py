"""The extent of a mesh in a distorted image, where straight edges are curves."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.camera import Camera

_EDGE_STEPS = np.linspace(0.0, 1.0, 257)


def edges_of(faces: IntArray) -> IntArray:
    """(T, 3) triangles → (E, 2) edges as pairs of vertex indices, each edge once."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def extent_px(
    camera: Camera, vertices_cam_m: FloatArray, edges: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Least and greatest image position (u, v), (2,) each, of the projected mesh, px.

    They are NaN if a vertex cannot be projected. The outline of the mesh consists of edges, so the
    extremes lie on the edges' curves. Only edges that may be outermost are sampled closely, which gives
    10⁻³ px.

    Args:
        vertices_cam_m: (V, 3) camera axes.
        edges: (E, 2) vertex indices.
    """
    corners_px = camera.project(vertices_cam_m)
    if camera.distortion is None or np.isnan(corners_px).any():
        return corners_px.min(axis=0), corners_px.max(axis=0)
    flat = vertices_cam_m / vertices_cam_m[:, 2:]
    start, end = flat[edges[:, 0]], flat[edges[:, 1]]
    first, last = corners_px[edges[:, 0]], corners_px[edges[:, 1]]
    bulge = np.zeros_like(first)
    for t in (0.25, 0.5, 0.75):
        off = camera.project(start + t * (end - start)) - (first + t * (last - first))
        np.maximum(bulge, np.abs(off), out=bulge)
    slack = 2 * bulge + 1e-6
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    may_be_outer = (np.minimum(first, last) - slack < low) | (np.maximum(first, last) + slack > high)
    outer = np.flatnonzero(may_be_outer.any(axis=1))
    curves = start[outer] + _EDGE_STEPS[:, None, None] * (end - start)[outer]
    points = np.concatenate([camera.project(curves).reshape(-1, 2), corners_px])
    return points.min(axis=0), points.max(axis=0)
