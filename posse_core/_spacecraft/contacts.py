"""Which parts of a spacecraft touch, and what falls off if one is taken away."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError, cKDTree

from posse_core._arrays import FloatArray, IntArray
from posse_core._model.spacecraft import Part
from posse_core._randomness import random_generator

SPACING_SHARE = 0.004
"""Mean distance of the points by which surfaces are compared, as a share of the spacecraft's size."""
_REACH = 1.5
"""Parts touch if points of theirs are nearer than this, in units of that distance."""


def area_m2(part: Part) -> FloatArray:
    """(T,) areas of a part's triangles."""
    a, b, c = np.moveaxis(part.vertices_body_m[part.faces], 1, 0)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def bulk(part: Part) -> float:
    """Surface times volume of the convex hull, m⁵. It is the greatest for a bus, and not for panels that
    are large but thin, or for a frame around the bus."""
    try:
        volume_m3 = float(ConvexHull(part.vertices_body_m).volume)
    except QhullError:  # without any thickness
        return 0.0
    return volume_m3 * float(area_m2(part).sum())


class Contacts:
    """The graph of the parts that touch.

    Attributes:
        main: index of the part with the greatest :func:`bulk`, which holds the others.
    """

    def __init__(self, parts: Sequence[Part], size_m: float) -> None:
        """Compare points on the surfaces of all parts of a spacecraft of the size."""
        spacing_m = SPACING_SHARE * size_m
        reach_m = _REACH * spacing_m
        clouds = [_points_m(part, spacing_m) for part in parts]
        trees = [cKDTree(cloud) for cloud in clouds]
        low = np.array([cloud.min(axis=0) for cloud in clouds]) - reach_m
        high = np.array([cloud.max(axis=0) for cloud in clouds])
        pairs = [
            (i, j)
            for i in range(len(parts))
            for j in range(i)
            if np.all(low[i] < high[j]) and np.all(low[j] < high[i])
        ]
        touching = []
        for i, j in pairs:
            tree, cloud = (
                (trees[i], clouds[j]) if len(clouds[j]) < len(clouds[i]) else (trees[j], clouds[i])
            )
            within = np.all((cloud > tree.mins - reach_m) & (cloud < tree.maxes + reach_m), axis=1)
            if np.any(tree.query(cloud[within], distance_upper_bound=reach_m)[0] < reach_m):
                touching.append((i, j))
        self._count = len(parts)
        self._touching = np.array(touching, dtype=np.int64).reshape(-1, 2)
        self.main = int(np.argmax([bulk(part) for part in parts]))
        self._held = self._connected(())

    def fallen_without(self, lost: Collection[int]) -> set[int]:
        """Indices of the parts that nothing connects to the main part if the lost ones are gone, with
        the lost ones. What was never connected stays."""
        left = self._connected(lost)
        return {k for k in range(self._count) if k in lost or (self._held[k] and not left[k])}

    def _connected(self, lost: Collection[int]) -> IntArray:
        """(P,) whether each part is connected to the main one without the lost ones."""
        kept = ~np.isin(self._touching, list(lost)).any(axis=1)
        i, j = self._touching[kept].T
        graph = coo_array((np.ones(len(i)), (i, j)), shape=(self._count, self._count))
        _, group = connected_components(graph, directed=False)
        return np.asarray(group == group[self.main])


def _points_m(part: Part, spacing_m: float) -> FloatArray:
    """(N, 3) a part's vertices, and random points on its surface at the mean distance; always the
    same."""
    area = area_m2(part)
    rng = random_generator(0, -1, f"contacts {part.name}")
    count = int(np.ceil(2.0 * area.sum() / spacing_m**2))
    face = rng.choice(len(area), size=count, p=area / area.sum()) if area.sum() > 0 else np.zeros(0, int)
    u, v = rng.uniform(size=(2, len(face), 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(part.vertices_body_m[part.faces[face]], 1, 0)
    return np.concatenate([part.vertices_body_m, a + u * (b - a) + v * (c - a)])
