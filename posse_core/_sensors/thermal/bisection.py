"""Division of triangles into smaller ones, by halving their longest edges (Rivara 1984, Int. J. Numer.
Meth. Eng. 20, 745): triangles of any shape become about equally long, and none becomes slimmer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._geometry.triangles import dot

SLIVER = 0.02
"""A triangle whose area is a smaller share of the longest edge's square is not divided further, as
tubes would need too many."""


@dataclass(frozen=True, eq=False)
class Bisection:
    """A tree whose first nodes are T triangles, and whose leaves are their N smallest parts.

    Attributes:
        leaf_corners_m: (N, 3 corners, 3) of the leaves.
        leaf_triangle: (N,) the triangle that each leaf is a part of.
        children: (M, 2) nodes into which a node is divided, or −1.
        leaf: (M,) index of a node among the leaves; −1 for one that is divided.
        across: (3, M) normal of the line that divides a node, in the triangle's plane, towards its
            second child.
        offset_m: (M,) a point x is in the second child if across · x > offset_m.
    """

    leaf_corners_m: FloatArray
    leaf_triangle: IntArray
    children: IntArray
    leaf: IntArray
    across: FloatArray
    offset_m: FloatArray

    @classmethod
    def of(cls, corners_m: FloatArray, longest_m: float) -> Bisection:
        """Halve (T, 3 corners, 3) triangles until no edge is longer than ``longest_m``.

        Slivers whose area is below :data:`SLIVER` of its square stay as they are.
        """
        corners, triangles = [corners_m], [np.arange(len(corners_m))]
        children, across, offset = [], [], []
        total = len(corners_m)
        while len(corners[-1]):
            here = corners[-1]
            edges_m = np.linalg.norm(np.roll(here, -1, axis=1) - here, axis=2)
            edge = edges_m.argmax(axis=1)
            sides = here[:, 1:] - here[:, :1]
            area_m2 = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
            split = np.flatnonzero((edges_m.max(axis=1) > longest_m) & (area_m2 > SLIVER * longest_m**2))
            turned = (edge[split, None] + np.arange(3)) % 3
            a, b, c = np.moveaxis(here[split[:, None], turned], 1, 0)  # the longest edge is from a to b
            middle = (a + b) / 2
            normal = np.cross(b - a, c - a)
            line_normal = np.cross(normal, c - middle)
            line_normal *= np.sign(np.sum(line_normal * (b - a), axis=1, keepdims=True))
            level_children = np.full((len(here), 2), -1)
            level_children[split] = total + np.arange(2 * len(split)).reshape(-1, 2)
            level_across, level_offset = np.zeros((len(here), 3)), np.zeros(len(here))
            level_across[split] = line_normal
            level_offset[split] = np.sum(line_normal * middle, axis=1)
            halves = np.stack([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)], 1)
            corners.append(halves.reshape(-1, 3, 3))
            triangles.append(np.repeat(triangles[-1][split], 2))
            children.append(level_children)
            across.append(level_across)
            offset.append(level_offset)
            total += 2 * len(split)
        tree = np.concatenate(children)
        leaves = np.flatnonzero(tree[:, 0] < 0)
        leaf = np.full(total, -1)
        leaf[leaves] = np.arange(len(leaves))
        return cls(
            leaf_corners_m=np.concatenate(corners)[leaves],
            leaf_triangle=np.concatenate(triangles)[leaves],
            children=tree,
            leaf=leaf,
            across=np.ascontiguousarray(np.concatenate(across).T),
            offset_m=np.concatenate(offset),
        )

    def at(self, triangle: IntArray, point_m: FloatArray) -> IntArray:
        """The leaves at points (3, K) on triangles (K,)."""
        node = np.array(triangle)
        divided = np.flatnonzero(self.leaf[node] < 0)
        while len(divided):
            here = node[divided]
            height_m = dot(np.take(self.across, here, axis=1), np.take(point_m, divided, axis=1))
            second = height_m > self.offset_m[here]
            node[divided] = self.children[here, second.astype(np.intp)]
            divided = divided[self.leaf[node[divided]] < 0]
        return np.asarray(self.leaf[node])
