"""The light that reaches a camera: the sky's and the spacecraft's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import Float32Array
from posse_core._model.camera import Camera
from posse_core._model.scene import FrameState, Radiance
from posse_core._model.sky_view import SkyView


@dataclass(frozen=True)
class LightRequest:
    """A request to collect the light of a camera.

    Attributes:
        state: in the camera's axes.
        camera: whose pixels the light reaches.
        exposure_s: over which the light is averaged.
        instants: the largest number of instants that are averaged.
        purpose: of the renderer's random draws.
        earthshine: the state whose Earth-shine lights the spacecraft.
        sky: the sky, where it is known already; None to compute it.
    """

    state: FrameState
    camera: Camera
    exposure_s: float
    instants: int
    purpose: str
    earthshine: FrameState
    sky: SkyView | None = None


@dataclass(frozen=True)
class Light:
    """Light from sky and spacecraft in a camera's pixels.

    Attributes:
        camera: whose pixels they are.
        sky: light from behind the spacecraft, as if it were not there; stars are points.
        craft: light of the spacecraft alone, in the box that holds it; None where it is not in view.
    """

    camera: Camera
    sky: SkyView
    craft: Radiance | None

    def radiance_rgb(self) -> Float32Array:
        """(H, W, 3) radiance of the spacecraft and of the sky beside it, averaged over each pixel,
        W m⁻² sr⁻¹ in the red, green and blue band; stars, which are points, are not in it."""
        if self.sky.radiance_rgb is None:
            shape = (self.camera.height_px, self.camera.width_px, 3)
            radiance_rgb = np.zeros(shape, dtype=np.float32)
        else:
            radiance_rgb = self.sky.radiance_rgb.copy()
        if self.craft is not None:
            inside = radiance_rgb[self.craft.box.slices]
            inside *= 1 - self.craft.coverage[..., None]
            inside += self.craft.radiance_rgb
        return radiance_rgb
