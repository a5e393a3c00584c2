"""What varies smoothly along the ground, apart from maps and patterns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from posse_core._arrays import Float32Array


@dataclass(frozen=True)
class Surface:
    """Angles, light and weather at points on the ground.

    Everything is a part of one array, so that it can be interpolated at once. Radiance is per solar
    irradiance above the air, sr⁻¹, and is that which reaches the camera.

    Attributes:
        fields: (COUNT, ...) float32.
    """

    COUNT: ClassVar[int] = 17

    fields: Float32Array

    @property
    def normal(self) -> Float32Array:
        """(3, ...) unit normals of the ground, ECEF axes."""
        return self.fields[0:3]

    @property
    def drifted(self) -> Float32Array:
        """(3, ...) unit normals in the axes in which the clouds' pattern is at rest."""
        return self.fields[3:6]

    @property
    def footprint_m(self) -> Float32Array:
        """(...) width that a pixel covers."""
        return np.asarray(self.fields[6])

    @property
    def threshold(self) -> Float32Array:
        """(...) the value of the clouds' field above which there is cloud."""
        return np.asarray(self.fields[7])

    @property
    def daylight(self) -> Float32Array:
        """(3, ...) radiance of ground that reflects all light."""
        return self.fields[8:11]

    @property
    def glitter(self) -> Float32Array:
        """(3, ...) radiance of the glint on water."""
        return self.fields[11:14]

    @property
    def airlight(self) -> Float32Array:
        """(3, ...) radiance of the air."""
        return self.fields[14:17]

    @property
    def is_dark(self) -> bool:
        """Whether all light is zero, as far in the night."""
        return not self.fields[8:17].any()
