"""The light that a frame's picture is made of, gathered while the shutter is open."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import CraftState
from posse_core._model.scene import FrameState, Radiance, RenderRequest
from posse_core._model.shutter import STEP_PX
from posse_core._randomness import derived_seed
from posse_core._sky.sky import Sky

BOX_MARGIN_PX = 1
"""Pixels around the geometry's box that are rendered too: the craft may cover a part of them."""


class CraftLight:
    """Renders the spacecraft at the moments of an exposure, each only where its rows see it."""

    def __init__(
        self,
        renderer: Renderer,
        geometry: RayCaster,
        sky: Sky,
        camera: Camera,
        seed: int,
        purpose: str,
    ) -> None:
        """seed: of the run; purpose: of the renderer's random draws."""
        self._renderer = renderer
        self._geometry = geometry
        self._sky = sky
        self._camera = camera
        self._seed = seed
        self._purpose = purpose

    def gather(
        self, frame: FrameState, exposure_s: float, instants: int, earthshine: FrameState
    ) -> Radiance | None:
        """Mean radiance over an exposure, in ``instants`` at most; None where no ray meets the craft.

        ``earthshine`` is the state whose Earth-shine lights the craft at all instants.
        """
        shots = list(self._shots(frame, exposure_s, instants))
        whole = PixelBox.around(shot.box for shot in shots)
        if whole.is_empty:
            return None
        environment = self._sky.environment(earthshine)
        radiance_rgb = np.zeros((whole.height, whole.width, 3), dtype=np.float32)
        coverage = np.zeros((whole.height, whole.width), dtype=np.float32)
        for number, shot in enumerate(shots):
            purpose = f"{self._purpose} {number}" if number else self._purpose
            seed = derived_seed(self._seed, frame.index, purpose)
            made = self._renderer.render(
                RenderRequest(shot.craft, shot.box, environment, seed, frame.index)
            )
            inside = shot.box.within(whole)
            radiance_rgb[inside] += shot.share * made.radiance_rgb
            coverage[inside] += shot.share * made.coverage
        return Radiance(whole, radiance_rgb, np.minimum(coverage, 1))

    def _shots(self, frame: FrameState, exposure_s: float, instants: int) -> Iterator[_Shot]:
        for moment in self._geometry.moments(frame.craft, STEP_PX, exposure_s, instants):
            craft = frame.craft.after(moment.after_s)
            box = self._geometry.box(craft).grown(BOX_MARGIN_PX, self._camera)
            box = box.within_rows(moment.first_row, moment.rows)
            if not box.is_empty:
                yield _Shot(craft, box, np.float32(moment.share))


@dataclass(frozen=True)
class _Shot:
    """A moment of an exposure: what is rendered, where, and its share."""

    craft: CraftState
    box: PixelBox
    share: np.float32
