"""Ragged holes in the surface of a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._model.spacecraft import Part
from posse_core._spacecraft.contacts import area_m2
from posse_core._spacecraft.corners import edges

SMALLEST_SHARE, LARGEST_SHARE = 0.12, 0.3
"""Radius of a hole, as a share of the square root of the part's surface."""
_STEPS = 6
"""Triangles around a hole are cut until their edges are shorter than its radius / this."""
_MOST_ROUNDS = 40


def torn(part: Part, rng: np.random.Generator) -> Part:
    """The part with a ragged hole about a random point of its surface, through thin walls.

    The triangles around the hole are cut into small ones that still meet edge to edge, and those within
    a random distance of the point, which changes with the direction, are removed.
    """
    area = area_m2(part)
    face = int(rng.choice(len(area), p=area / area.sum()))
    u, v = np.sort(rng.uniform(size=2))
    a, b, c = part.vertices_body_m[part.faces[face]]
    centre_m = u * a + (v - u) * b + (1.0 - v) * c
    radius_m = float(rng.uniform(SMALLEST_SHARE, LARGEST_SHARE) * np.sqrt(area.sum()))
    corners = np.concatenate([part.vertices_body_m, part.normals_body, part.uv], axis=1)[part.faces]
    corners = refined(corners, centre_m, 1.5 * radius_m, radius_m / _STEPS)
    middle = corners[:, :, :3].mean(axis=1) - centre_m
    distance_m = np.linalg.norm(middle, axis=1)
    # Lobes in a few random directions, and an edge that is uneven from one triangle to the next.
    lobes = rng.standard_normal((5, 3)) * 3.0 / radius_m
    ragged = 1.0 + 0.18 * np.sin(middle @ lobes.T + rng.uniform(0.0, 2.0 * np.pi, 5)).sum(axis=1)
    ragged += rng.uniform(-0.1, 0.1, len(corners))
    kept = corners[distance_m > radius_m * np.clip(ragged, 0.4, 1.5)]
    if not len(kept):
        return part
    flat = kept.reshape(-1, 8)
    normals = flat[:, 3:6] / np.linalg.norm(flat[:, 3:6], axis=1, keepdims=True)
    return replace(
        part,
        vertices_body_m=np.ascontiguousarray(flat[:, :3]),
        normals_body=normals.astype(np.float32),
        uv=flat[:, 6:].astype(np.float32),
        faces=np.arange(len(flat), dtype=np.int32).reshape(-1, 3),
    )


def refined(corners: FloatArray, centre_m: FloatArray, reach_m: float, longest_m: float) -> FloatArray:
    """Cut triangles until none that comes near a point has an edge longer than a limit.

    An edge is cut in its middle in all triangles that have it, so no gaps arise, even between triangles
    that were not near.

    Args:
        corners: (T, 3 corners, C) triangles; the first three of C are the position, m, and the rest is
            interpolated.
        centre_m: (3,) the point.
        reach_m: what is nearer than this is near.
        longest_m: the limit.

    Returns:
        (T', 3, C) the same surface.
    """
    for _ in range(_MOST_ROUNDS):
        position = corners[:, :, :3]
        middle = position.mean(axis=1)
        round_m = np.linalg.norm(position - middle[:, None], axis=2).max(axis=1)
        near = np.linalg.norm(middle - centre_m, axis=1) < reach_m + round_m
        length_m = np.linalg.norm(np.roll(position, -1, axis=1) - position, axis=2)
        # The longest edges first, so that slivers become better shaped.
        limit = np.maximum(longest_m, 0.7 * length_m.max(axis=1))
        wanted = near[:, None] & (length_m > longest_m) & (length_m >= limit[:, None])
        if not wanted.any():
            break
        edge = edges(position)
        marked = np.zeros(edge.max() + 1, dtype=bool)
        marked[edge[wanted]] = True
        corners = _cut(corners, marked[edge])
    return corners


def _cut(corners: FloatArray, cut: BoolArray) -> FloatArray:
    """Divide triangles (T, 3, C) whose edges (T, 3) are cut in the middle."""
    middle = (corners + np.roll(corners, -1, axis=1)) / 2.0
    pieces = [corners[~cut.any(axis=1)]]
    whole = cut.all(axis=1)
    a, b, c = np.moveaxis(corners[whole], 1, 0)
    ab, bc, ca = np.moveaxis(middle[whole], 1, 0)
    pieces += [np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    for k in range(3):
        # Seen from corner k: its own edge is cut, and the next one in the second case.
        one = cut[:, k] & ~cut[:, k - 1] & ~cut[:, k - 2]
        a, b, c = np.moveaxis(np.roll(corners[one], -k, axis=1), 1, 0)
        ab = middle[one, k]
        pieces += [np.stack(each, axis=1) for each in ((a, ab, c), (ab, b, c))]
        two = cut[:, k] & cut[:, (k + 1) % 3] & ~cut[:, k - 1]
        a, b, c = np.moveaxis(np.roll(corners[two], -k, axis=1), 1, 0)
        ab, bc = middle[two, k], middle[two, (k + 1) % 3]
        pieces += [np.stack(each, axis=1) for each in ((ab, b, bc), (a, ab, bc), (a, bc, c))]
    return np.concatenate(pieces)
