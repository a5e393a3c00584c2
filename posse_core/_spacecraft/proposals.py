"""Proposals for keypoints and symmetries, from the geometry alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._frames import R_about
from posse_core._model.spacecraft import Part, Spacecraft

DIRECTIONS = 64
"""Number of directions, evenly distributed over the sphere, for which visibility is computed."""
CANDIDATES = 4000
ORDERS = (2, 3, 4, 6)
_WORDS = {
    "S": re.compile(r"solar|panel|array|wing|cell", re.IGNORECASE),
    "A": re.compile(r"antenna|dish|boom|reflector|horn|omni|mast", re.IGNORECASE),
}


def sphere(count: int) -> FloatArray:
    """Unit vectors (count, 3), evenly distributed over the sphere (Fibonacci lattice; González 2010)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    return np.column_stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z])


def propose_keypoints(craft: Spacecraft, count: int) -> dict[str, FloatArray]:
    """Propose up to ``count`` vertices that are well spread and visible from many sides.

    Each next keypoint is the vertex with the largest product of its distance to those already chosen,
    the square root of the share of directions from which it is visible, and its sharpness: a corner
    counts three times as much as a point on an edge or a face. The result depends on the mesh alone.

    Keypoints are named by category. Parts or materials named after panels or antennas give the
    categories S and A. All others are on the main body: T above the origin (body −Z, away from the
    nadir), B below it.

    Returns:
        name → (3,) position, m, body axes, sorted by category and number.
    """
    points, part_ids, sharpness = _candidates(craft)
    seen = _visibility(craft, points)
    weight = np.sqrt(seen.mean(axis=1)) * (1.0 + 2.0 * sharpness)
    distance = np.linalg.norm(points, axis=1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(points)):
        best = int(np.argmax(distance * weight))
        if distance[best] * weight[best] <= 0.0:
            break
        chosen.append(best)
        away = np.linalg.norm(points - points[best], axis=1)
        distance = away if len(chosen) == 1 else np.minimum(distance, away)
    return _named(craft, points[chosen], part_ids[chosen])


def _candidates(craft: Spacecraft) -> tuple[FloatArray, IntArray, FloatArray]:
    """At most :data:`CANDIDATES` vertices (N, 3), the index of each one's part, and its sharpness 0 … 1.

    Of the vertices in a cell of a grid, only the one farthest from the origin is kept.
    """
    points = np.concatenate([part.vertices_body_m for part in craft.parts])
    sizes = [len(part.vertices_body_m) for part in craft.parts]
    part_ids = np.repeat(np.arange(len(craft.parts)), sizes)
    sharpness = np.concatenate([_sharpness(part) for part in craft.parts])
    far = np.linalg.norm(points, axis=1)
    cell = craft.radius_m / 1000.0
    while True:
        grid = np.floor(points / cell).astype(np.int64)
        order = np.lexsort((*points.T, -far))
        _, first = np.unique(grid[order], axis=0, return_index=True)
        if len(first) <= CANDIDATES:
            keep = order[first]
            return points[keep], part_ids[keep], sharpness[keep]
        cell *= 1.5


def _sharpness(part: Part) -> FloatArray:
    """(V,) sharpness of each vertex: 1 at a cube's corner, 0 on a straight edge or a face.

    It is three times the least eigenvalue of the mean of n nᵀ over the faces at the vertex, weighted by
    their angles, where n is a face's normal.
    """
    _, position = np.unique(np.round(part.vertices_body_m, 9), axis=0, return_inverse=True)
    position = position.reshape(-1)
    corners = part.vertices_body_m[part.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    spread = np.zeros((position.max() + 1, 3, 3))
    total = np.zeros(len(spread))
    for k in range(3):
        u = corners[:, (k + 1) % 3] - corners[:, k]
        v = corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
        at = position[part.faces[:, k]]
        np.add.at(spread, at, angle[:, None, None] * normal[:, :, None] * normal[:, None, :])
        np.add.at(total, at, angle)
    least = np.linalg.eigvalsh(spread / np.maximum(total, 1e-300)[:, None, None])[:, 0]
    return np.asarray(np.clip(3.0 * least, 0.0, 1.0)[position])


def _visibility(craft: Spacecraft, points: FloatArray) -> BoolArray:
    """(N, DIRECTIONS) whether a point is visible from far away, with no part of the spacecraft in
    front."""
    starts = np.cumsum([0, *(len(part.vertices_body_m) for part in craft.parts[:-1])])
    mesh = trimesh.Trimesh(
        np.concatenate([part.vertices_body_m for part in craft.parts]),
        np.concatenate([part.faces + s for part, s in zip(craft.parts, starts, strict=True)]),
        process=False,
    )
    directions = sphere(DIRECTIONS)
    start = points[:, None, :] + 1e-3 * craft.radius_m * directions
    rays = np.broadcast_to(directions, start.shape)
    caster: Any = mesh.ray
    hit = caster.intersects_any(start.reshape(-1, 3), rays.reshape(-1, 3))
    return ~np.asarray(hit).reshape(len(points), DIRECTIONS)


def category_of(part: Part) -> str | None:
    """The category of keypoints, S or A, that the name of a part or of its material tells, or None."""
    label = f"{part.name} {part.material}"
    return next((category for category, words in _WORDS.items() if words.search(label)), None)


def _named(craft: Spacecraft, points: FloatArray, part_ids: IntArray) -> dict[str, FloatArray]:
    groups: dict[str, list[FloatArray]] = {category: [] for category in "TBAS"}
    for point, part_id in zip(points, part_ids, strict=True):
        body = "T" if point[2] < 0.0 else "B"
        groups[category_of(craft.parts[int(part_id)]) or body].append(point)
    return {
        f"{category}{number}": point
        for category, members in groups.items()
        for number, point in enumerate(members, start=1)
    }


def rotations(axes: Sequence[tuple[str, int]]) -> tuple[FloatArray, ...]:
    """The group of rotations (3, 3) that rotations about body axes generate, without the identity.

    Args:
        axes: pairs of an axis ``x``, ``y`` or ``z`` and an order, such as ("z", 4) for quarter turns.

    Raises:
        ValueError: they generate more than 60 rotations, so they are not the symmetries of a solid.
    """
    generators = [R_about(np.eye(3)["xyz".index(axis)], 2.0 * np.pi / order) for axis, order in axes]
    group = [np.eye(3)]
    for R in group:
        for generator in generators:
            product = generator @ R
            if not any(np.allclose(product, known, atol=1e-9) for known in group):
                group.append(product)
        if len(group) > 60:
            raise ValueError("only a sphere has all these symmetries together")
    return tuple(group[1:])


def shape_symmetries(craft: Spacecraft, tolerance: float = 0.01) -> list[tuple[str, int]]:
    """Rotations about the body axes that leave the shape (not necessarily the appearance) unchanged.

    Points distributed over the surface are rotated, and each must then be near an original point: within
    twice the spacing of the points plus ``tolerance`` times the radius. Small features therefore do not
    count.

    Returns:
        Axis and highest order, for each axis that has a symmetry.
    """
    surface = _surface_points(craft)
    tree = cKDTree(surface)
    spacing = float(np.quantile(tree.query(surface, k=2)[0][:, 1], 0.99))
    reach = tolerance * craft.radius_m + 2.0 * spacing
    found = []
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        for order in reversed(ORDERS):
            turned = surface @ R_about(direction, 2.0 * np.pi / order).T
            near = np.isfinite(tree.query(turned, distance_upper_bound=reach)[0])
            if near.mean() > 0.999:
                found.append((axis, order))
                break
    return found


def _surface_points(craft: Spacecraft, count: int = 20000) -> FloatArray:
    """Points (count, 3) distributed over the surface by area, by a (repeatable) low-discrepancy
    sequence."""
    corners = np.concatenate([part.vertices_body_m[part.faces] for part in craft.parts])
    edges = corners[:, 1:] - corners[:, :1]
    share = np.cumsum(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))
    k = np.arange(count)
    # Additive recurrence with powers of the plastic number's generalisation to 3 dimensions (Roberts
    # 2018).
    g = 1.22074408460575947536
    pick, a, b = ((0.5 + k * g**-power) % 1.0 for power in (1, 2, 3))
    face = np.minimum(np.searchsorted(share, pick * share[-1]), len(corners) - 1)
    fold = a + b > 1.0
    a, b = np.where(fold, 1.0 - a, a), np.where(fold, 1.0 - b, b)
    return np.asarray(corners[face, 0] + a[:, None] * edges[face, 0] + b[:, None] * edges[face, 1])
