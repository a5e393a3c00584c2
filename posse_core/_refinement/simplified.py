"""Meshes of many triangles, with fewer that look alike in a drawing of a few hundred pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posse_core._model.spacecraft import Part

_MANY = 20_000
"""So many triangles of a spacecraft are drawn as they are."""
_STEP_SHARES = (1.0 / 400.0, 1.0 / 200.0, 1.0 / 100.0)
"""Vertices within a cube of one of these sides, as shares of the spacecraft's radius, become one: a
quarter of a pixel to a pixel of the finest drawings."""


def simplified(parts: Sequence[Part], radius_m: float) -> tuple[Part, ...]:
    """Return the parts of a spacecraft with fewer triangles, if they have many: by the smallest step
    that leaves few, or else by the largest.

    Vertices of one cell of a grid move to their mean (Rossignac & Borrel 1993), and keep their normals
    and texture coordinates. Triangles that lose their area, or that are there already, are left out.
    """
    made = list(parts)
    for share in _STEP_SHARES:
        if sum(len(part.faces) for part in made) <= _MANY:
            break
        made = [_clustered(part, share * radius_m) for part in parts]
    return tuple(part for part in made if len(part.faces))


def _clustered(part: Part, step_m: float) -> Part:
    cells = np.rint(part.vertices_body_m / step_m).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    count = np.bincount(cell)
    means_m = np.stack([np.bincount(cell, x_m) / count for x_m in part.vertices_body_m.T], axis=1)
    ends = np.sort(cell[part.faces], axis=1)
    _, first = np.unique(ends, axis=0, return_index=True)
    is_kept = np.zeros(len(ends), dtype=bool)
    is_kept[first] = True
    is_kept &= (np.diff(ends, axis=1) > 0).all(axis=1)
    used, faces = np.unique(part.faces[is_kept], return_inverse=True)
    return replace(
        part,
        vertices_body_m=means_m[cell[used]],
        faces=faces.reshape(-1, 3).astype(np.int32),
        normals_body=part.normals_body[used],
        uv=part.uv[used],
    )
