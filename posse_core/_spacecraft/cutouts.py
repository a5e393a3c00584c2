"""Cuts out of a mesh what its material's alpha makes transparent, as in decals and lattices.

The geometry itself is cut, so that labels and every renderer have the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray, IntArray
from posse_core._spacecraft.raw import RawPart

_MOST = 200_000
"""A part is not divided into more triangles than about this."""
_ON_A_BORDER = 1e-6
"""A corner this near to a texel's border is on it, texels."""


@dataclass(frozen=True)
class Alpha:
    """How opaque a material is.

    Attributes:
        factor: 0 … 1.
        texture: (H, W) uint8, which multiplies it; row 0 is at v = 1. None without one.
        cutoff: what is less opaque is not there.
    """

    factor: float
    texture: AnyArray | None
    cutoff: float

    def solid(self) -> BoolArray:
        """(H, W) whether a texel is there; (1, 1) without a texture."""
        texture = np.full((1, 1), 255, dtype=np.uint8) if self.texture is None else self.texture
        return np.asarray(self.factor * (texture / 255.0) >= self.cutoff)


def cut_out(part: RawPart, alpha: Alpha) -> RawPart:
    """The part without its transparent texels, each of which counts as of one colour; textures repeat.

    Triangles with solid and transparent texels are divided until they lie within a texel.
    """
    solid = alpha.solid()
    if solid.all():
        return part
    if not solid.any():
        return replace(part, faces=part.faces[:0])
    texels = _Texels(solid)
    corners = np.concatenate([part.vertices, part.normals, part.uv], axis=1)[part.faces]
    whole: list[FloatArray] = []
    while len(corners):
        places = texels.places(corners[..., 6:])
        share = texels.solid_share(places)
        whole.append(corners[share == 1.0])
        mixed = (share > 0.0) & (share < 1.0)
        size = np.ptp(places, axis=1).max(axis=1)
        is_full = sum(map(len, whole)) + 4 * int(mixed.sum()) > _MOST
        small = mixed & ((size <= 1.0) | is_full)
        whole.append(corners[small & texels.at(places.mean(axis=1))])
        corners = _quartered(corners[mixed & ~small])
    kept = np.concatenate(whole).reshape(-1, 8)
    length = np.linalg.norm(kept[:, 3:6], axis=1, keepdims=True)
    return replace(
        part,
        vertices=np.ascontiguousarray(kept[:, :3]),
        faces=np.arange(len(kept), dtype=np.int32).reshape(-1, 3),
        normals=(kept[:, 3:6] / np.where(length > 0.0, length, 1.0)).astype(np.float32),
        uv=kept[:, 6:].astype(np.float32),
    )


def _quartered(corners: FloatArray) -> FloatArray:
    """(4 T, 3, N) the quarters of triangles with corners (T, 3, N), by the middles of their sides."""
    middles = (corners + np.roll(corners, -1, axis=1)) / 2.0
    ends = [np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
    return np.concatenate([*ends, middles])


class _Texels:
    """A texture of solid and transparent texels that repeats without end."""

    def __init__(self, solid: BoolArray) -> None:
        """solid: (H, W)."""
        self._solid = solid
        self._sums = np.zeros((solid.shape[0] + 1, solid.shape[1] + 1), dtype=np.int32)
        self._sums[1:, 1:] = solid.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)

    def places(self, uv: FloatArray) -> FloatArray:
        """(..., 2) row and column, in texels from the upper left corner, of texture coordinates
        (..., 2)."""
        rows, columns = self._solid.shape
        return np.stack([(1.0 - uv[..., 1]) * rows, uv[..., 0] * columns], axis=-1)

    def at(self, places: FloatArray) -> BoolArray:
        """Whether the texel at a place (N, 2) is solid."""
        row, column = np.floor(places).astype(np.int64).T
        return np.asarray(self._solid[row % self._solid.shape[0], column % self._solid.shape[1]])

    def solid_share(self, places: FloatArray) -> FloatArray:
        """(T,) the share of solid texels in the boxes around triangles with corners (T, 3, 2)."""
        low = np.floor(places.min(axis=1) + _ON_A_BORDER).astype(np.int64)
        high = np.ceil(places.max(axis=1) - _ON_A_BORDER).astype(np.int64)
        high = np.maximum(high, low + 1)
        solid = (
            self._solid_before(high[:, 0], high[:, 1])
            - self._solid_before(low[:, 0], high[:, 1])
            - self._solid_before(high[:, 0], low[:, 1])
            + self._solid_before(low[:, 0], low[:, 1])
        )
        return np.asarray(solid / (high - low).prod(axis=1))

    def _solid_before(self, row: IntArray, column: IntArray) -> IntArray:
        """Solid texels above a row and left of a column, with sign, from the texture's corner."""
        rows, columns = self._solid.shape
        tiles_down, row = np.divmod(row, rows)
        tiles_across, column = np.divmod(column, columns)
        return np.asarray(
            tiles_down * tiles_across * self._sums[-1, -1]
            + tiles_down * self._sums[-1, column]
            + tiles_across * self._sums[row, -1]
            + self._sums[row, column]
        )
