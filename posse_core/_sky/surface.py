"""What varies smoothly along the ground, apart from maps and patterns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from posse_core._arrays import BoolArray, Float32Array


@dataclass(frozen=True)
class Surface:
    """Angles, light and weather at points on the ground, or at nodes between which they are linear.

    Everything is a part of one array, so that it can be interpolated at once. With ``weights`` each
    property is interpolated when it is asked for, and what nobody asks for costs nothing. Radiance is
    that which reaches the camera, W m⁻² sr⁻¹.

    Attributes:
        fields: (COUNT, ...) float32; (COUNT, n, k) with weights: at the k nodes of each of n cells.
        weights: (k, p) shares of the nodes in each of a cell's p points; properties are (..., n, p)
            then.
    """

    COUNT: ClassVar[int] = 21
    NORMALS: ClassVar[slice] = slice(0, 6)
    """Both unit normals."""
    LONGITUDES: ClassVar[slice] = slice(6, 8)
    """Fields that are the same again after a whole turn, 1."""
    LIGHT: ClassVar[slice] = slice(12, 21)
    """Daylight, sea and airlight."""

    fields: Float32Array
    weights: Float32Array | None = None

    @property
    def normal(self) -> Float32Array:
        """(3, ...) unit normals of the ground, ECEF axes."""
        return self._part(0, 3)

    @property
    def drifted(self) -> Float32Array:
        """(3, ...) unit normals in the axes in which the clouds' pattern is at rest."""
        return self._part(3, 6)

    @property
    def longitude(self) -> Float32Array:
        """(...) position along the rows of a map of the ground, in turns from 180° W."""
        return np.asarray(self._part(6, 7)[0])

    @property
    def drifted_longitude(self) -> Float32Array:
        """(...) the same on the clouds' map."""
        return np.asarray(self._part(7, 8)[0])

    @property
    def latitude(self) -> Float32Array:
        """(...) position down both maps, 0 at the north pole and 1 at the south pole."""
        return np.asarray(self._part(8, 9)[0])

    @property
    def log_footprint(self) -> Float32Array:
        """(...) binary logarithm of the width in metres that a pixel covers."""
        return np.asarray(self._part(9, 10)[0])

    @property
    def threshold(self) -> Float32Array:
        """(...) the value of the clouds' field above which there is cloud."""
        return np.asarray(self._part(10, 11)[0])

    @property
    def relief(self) -> Float32Array:
        """(...) how much darker clouds are for each unit of their slope towards the Sun."""
        return np.asarray(self._part(11, 12)[0])

    @property
    def daylight(self) -> Float32Array:
        """(3, ...) radiance of ground that reflects all light."""
        return self._part(12, 15)

    @property
    def sea(self) -> Float32Array:
        """(3, ...) radiance of water, with its glint."""
        return self._part(15, 18)

    @property
    def airlight(self) -> Float32Array:
        """(3, ...) radiance of the air."""
        return self._part(18, 21)

    def is_lit(self) -> BoolArray:
        """(...) whether the Sun or the sky lights the ground, of points without weights."""
        return np.asarray(self.daylight.any(axis=0) | self.sea.any(axis=0))

    def _part(self, first: int, end: int) -> Float32Array:
        """(end − first, ...) some of the fields."""
        part = self.fields[first:end]
        if self.weights is None:
            return part
        nodes, points = self.weights.shape
        return np.asarray((part.reshape(-1, nodes) @ self.weights).reshape(*part.shape[:2], points))
