"""A mesh seen by a camera, in plain float64: the referee of masks, depths and boxes.

It shares nothing with the ray-caster that labels come from. Every pixel's centre is tried against each
triangle whose projection may hold it, by the signed volumes that the ray spans with the triangle's
edges (Möller and Trumbore 1997 in homogeneous form), so triangles behind the camera need no clipping.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.camera import Camera

_STEPS = 8
"""Pieces that a distorted edge is first cut into."""
_PAIRS = 1 << 20
"""Pairs of pixel, or ray, and triangle that are tried at once."""
_CONE_SLACK = 1e-9
"""What rounding may take from the cosine of a cone around a triangle."""


@dataclass(frozen=True)
class FirstHits:
    """What the rays through the pixels' centres meet first.

    Attributes:
        depth_m: (H, W) planar depth; infinite off the mesh.
        face: (H, W) index of the triangle; −1 off the mesh.
        covered_px: (G,) number of pixels whose rays meet a triangle of each group, first or not.
    """

    depth_m: FloatArray
    face: IntArray
    covered_px: IntArray


def first_hits_by_rows(
    camera: Camera,
    vertices_cam_m: Callable[[float], FloatArray],
    faces: IntArray,
    group: IntArray,
) -> FirstHits:
    """:func:`first_hits` of a mesh that moves from row to row.

    vertices_cam_m: row → (V, 3) in its moment.
    """
    rows = np.linspace(0, camera.height_px - 1, 5)
    v_px = np.concatenate([_outline_px(camera, vertices_cam_m(row)[faces])[..., 1] for row in rows], 1)
    behind = np.isnan(v_px).any(axis=1)
    low = np.where(behind, -np.inf, v_px.min(axis=1) - 1)
    high = np.where(behind, np.inf, v_px.max(axis=1) + 1)
    depth_m = np.full((camera.height_px, camera.width_px), np.inf)
    face = np.full(depth_m.shape, -1)
    covered_px = np.zeros(group.max(initial=0) + 1, dtype=np.int64)
    for row in range(camera.height_px):
        near = np.flatnonzero((low <= row) & (high >= row))
        if len(near):
            line = replace(camera, height_px=1, cy_px=camera.cy_px - row)
            found = first_hits(line, vertices_cam_m(row), faces[near], group[near])
            depth_m[row] = found.depth_m[0]
            face[row] = np.where(found.face[0] < 0, -1, near[found.face[0]])
            covered_px[: len(found.covered_px)] += found.covered_px
    return FirstHits(depth_m, face, covered_px)


def depth_of_mesh(camera: Camera, vertices_cam_m: FloatArray, faces: IntArray) -> FloatArray:
    """Planar depth at each pixel's centre: (V, 3), (T, 3) → (H, W) metres, infinite off the mesh."""
    return first_hits(camera, vertices_cam_m, faces, np.zeros(len(faces), dtype=np.int64)).depth_m


def first_hits(
    camera: Camera, vertices_cam_m: FloatArray, faces: IntArray, group: IntArray
) -> FirstHits:
    """What each pixel's centre shows of triangles.

    Args:
        camera: whose pixels they are.
        vertices_cam_m: (V, 3) camera axes.
        faces: (T, 3) indices of vertices.
        group: (T,) number of the group that each triangle belongs to, from 0.
    """
    corners = vertices_cam_m[faces]
    kept = np.flatnonzero((corners[..., 2] > 0).any(axis=1))
    corners = corners[kept]
    normals, volume = _edge_planes(corners)
    first, size = _pixel_boxes(camera, corners)
    rays = _pixel_rays(camera)
    count = size[:, 0] * size[:, 1]
    groups = int(group.max(initial=0)) + 1
    depth = np.full(camera.width_px * camera.height_px, np.inf)
    face = np.full(len(depth), -1)
    covered = [np.zeros(0, dtype=np.int64)]
    for block in _blocks(count):
        triangle = np.repeat(np.arange(block.start, block.stop), count[block])
        start = np.cumsum(count[block]) - count[block]
        cell = np.arange(len(triangle)) - np.repeat(start, count[block])
        column = first[triangle, 0] + cell % np.maximum(size[triangle, 0], 1)
        row = first[triangle, 1] + cell // np.maximum(size[triangle, 0], 1)
        x, y = rays[row, column].T
        n = normals[triangle]
        sides = n[..., 0] * x[:, None] + n[..., 1] * y[:, None] + n[..., 2]
        inside = (sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)
        total = sides.sum(axis=1)
        hit = inside & (total * volume[triangle] > 0)
        z, index = volume[triangle[hit]] / total[hit], kept[triangle[hit]]
        pixel = row[hit] * camera.width_px + column[hit]
        np.minimum.at(depth, pixel, z)
        nearest = z == depth[pixel]
        face[pixel[nearest]] = index[nearest]
        covered.append(np.unique(pixel * groups + group[index]))
    pixels_of_groups = np.unique(np.concatenate(covered)) % groups
    return FirstHits(
        depth.reshape(camera.height_px, camera.width_px),
        face.reshape(camera.height_px, camera.width_px),
        np.bincount(pixels_of_groups, minlength=groups),
    )


class RayMeeting:
    """Rays from the camera against triangles (T, 3, 3), in camera axes."""

    def __init__(self, corners_cam_m: FloatArray) -> None:
        self._normals, self._volume = _edge_planes(corners_cam_m)
        towards = _unit(corners_cam_m)
        self._middle = _unit(towards.sum(axis=1))
        # A cone around the middle that is narrower than a half-space holds a triangle if it holds its
        # corners. One that the camera is in, or beside, is tried with every ray.
        cosine = np.einsum("tij,tj->ti", towards, self._middle).min(axis=1) - _CONE_SLACK
        self._cosine = np.where(cosine > 0, cosine, -np.inf)

    def lengths(self, rays: FloatArray) -> FloatArray:
        """How far along each ray (N, 3), in its own lengths, it first meets a triangle: (N,), infinite
        for none."""
        directions = _unit(rays)
        lengths = np.full(len(rays), np.inf)
        step = max(1, _PAIRS // max(1, len(self._middle)))
        for start in range(0, len(rays), step):
            ray, face = np.nonzero(~(directions[start : start + step] @ self._middle.T < self._cosine))
            ray += start
            sides = np.einsum("pij,pj->pi", self._normals[face], rays[ray])
            total = sides.sum(axis=1)
            inside = (sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)
            hit = inside & (total * self._volume[face] > 0)
            np.minimum.at(lengths, ray[hit], self._volume[face[hit]] / total[hit])
        return lengths


def _unit(vectors: FloatArray) -> FloatArray:
    """(..., 3) → the same of length 1; NaN where there is no direction, as of a corner at the camera."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, np.nan))


def _edge_planes(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals (T, 3, 3) of the planes through the camera and each edge, and the volume (T,) of the
    parallelepiped that the corners span."""
    normals = np.stack([np.cross(corners[:, i], corners[:, (i + 1) % 3]) for i in range(3)], axis=1)
    return normals, np.einsum("ti,ti->t", normals[:, 0], corners[:, 2])


def extent_px(camera: Camera, corners_cam_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest (u, v), (2,) each, of projected triangles (T, 3, 3); NaN if one has no image.

    A distorted edge that comes near the extremes is followed in small steps.
    """
    around = _outline_px(camera, corners_cam_m)
    if camera.distortion is None or np.isnan(around).any():
        return around.min(axis=(0, 1)), around.max(axis=(0, 1))
    uv_px = camera.project(corners_cam_m)
    low, high = uv_px.min(axis=(0, 1)), uv_px.max(axis=(0, 1))
    outer = (around.min(axis=1) <= low) | (around.max(axis=1) >= high)
    fine = _edge_points_px(camera, corners_cam_m[outer.any(axis=1)], _STEPS**3)
    return fine.min(axis=(0, 1)), fine.max(axis=(0, 1))


def _outline_px(camera: Camera, corners: FloatArray) -> FloatArray:
    """(T, 3, 3) triangles → (T, n, 2) points around each one's image: its corners, or its box;
    NaN behind the camera and beyond its lens."""
    if camera.distortion is None:
        return camera.project(corners)
    curves = _edge_points_px(camera, corners, _STEPS)
    # Between two points an edge leaves its chord by 1/n² of what it does as a whole.
    stray = np.ptp(curves, axis=1, keepdims=True).max(axis=-1, keepdims=True) / _STEPS**2 + 1e-6
    low, high = curves.min(axis=1, keepdims=True) - stray, curves.max(axis=1, keepdims=True) + stray
    return np.concatenate([low, high], axis=1)


def _edge_points_px(camera: Camera, corners: FloatArray, steps: int) -> FloatArray:
    """(T, 3, 3) triangles → (T, 3 steps, 2) projections of points on their edges, the corners too."""
    flat = corners / np.where(corners[..., 2:] > 0, corners[..., 2:], np.nan)
    onward = np.roll(flat, -1, axis=1) - flat
    share = np.arange(steps)[:, None, None] / steps
    points = flat[:, None] + share * onward[:, None]
    return camera.project(points.reshape(len(corners), -1, 3))


@lru_cache(maxsize=1)
def _pixel_rays(camera: Camera) -> FloatArray:
    """(H, W, 2) x and y, at z = 1, of the directions of pixels' centres."""
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    return np.ascontiguousarray(camera.rays(np.stack([columns, rows], axis=-1))[..., :2])


def _pixel_boxes(camera: Camera, corners: FloatArray) -> tuple[IntArray, IntArray]:
    """First pixel (column, row) and size, (T, 2) each, of what a triangle may cover of the image."""
    limit = np.array([camera.width_px, camera.height_px])
    # NaN behind the camera, or beyond its lens: such a triangle may be anywhere.
    uv_px = _outline_px(camera, corners)
    low, high = np.ceil(uv_px.min(axis=1)), np.floor(uv_px.max(axis=1)) + 1
    low, high = np.where(np.isnan(low), 0, low), np.where(np.isnan(high), limit, high)
    first = np.clip(low, 0, limit).astype(np.int64)
    return first, np.maximum(np.clip(high, 0, limit).astype(np.int64) - first, 0)


def _blocks(count: IntArray) -> list[slice]:
    """Consecutive triangles with about ``_PAIRS`` pixels together, and at least one triangle."""
    ends = np.cumsum(count)
    cuts = [0]
    while cuts[-1] < len(count):
        done = ends[cuts[-1] - 1] if cuts[-1] else 0
        cuts.append(max(cuts[-1] + 1, int(np.searchsorted(ends, done + _PAIRS, side="right"))))
    return [slice(a, b) for a, b in pairwise(cuts)]
