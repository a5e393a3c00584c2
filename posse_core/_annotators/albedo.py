"""The annotator of the surface's own colour."""

from __future__ import annotations

import numpy as np

from posse_core._geometry.rows import surface_points
from posse_core._geometry.surface import Surface
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look
from posse_core._model.labels import Labels
from posse_core._model.spacecraft import Spacecraft


class AlbedoAnnotator(Annotator):
    """The array ``base_color_rgb``."""

    _known: tuple[Spacecraft, Surface] | None = None

    def annotate(self, look: Look) -> Labels:
        view = look.view()
        color = np.full((*view.mask.shape, 3), np.nan, dtype=np.float32)
        _, _, x_body_m = surface_points(look.state.craft, look.scene.camera, view)
        surface = self._surface(look.scene.spacecraft)
        color[view.mask] = surface.at(view.triangle[view.mask], x_body_m).base_color
        return Labels(arrays={"base_color_rgb": color})

    def _surface(self, spacecraft: Spacecraft) -> Surface:
        """The surface of the spacecraft, made when a look first shows it."""
        if self._known is None or self._known[0] is not spacecraft:
            self._known = spacecraft, Surface(spacecraft)
        return self._known[1]
