"""The annotator of the surface's own colour."""

from __future__ import annotations

import numpy as np

from posse_core._annotators.points import shown
from posse_core._geometry.surface import Surface
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look
from posse_core._model.labels import Labels
from posse_core._model.scene import Piece, Scene


class AlbedoAnnotator(Annotator):
    """The array ``base_color_rgb``."""

    _known: tuple[tuple[Piece, ...], Surface] | None = None

    def annotate(self, look: Look) -> Labels:
        view = look.view()
        color = np.full((*view.part_id.shape, 3), np.nan, dtype=np.float32)
        _, _, x_link_m = shown(look)
        surface, materials = self._surface(look.scene), look.scene.materials(look.state.craft)
        color[view.hit] = surface.base_color(view.triangle[view.hit], x_link_m, materials)
        return Labels(arrays={"base_color_rgb": color})

    def _surface(self, scene: Scene) -> Surface:
        """The surface of the scene's bodies, made when a look first shows them."""
        if self._known is None or self._known[0] is not scene.pieces:
            self._known = scene.pieces, Surface(scene.pieces)
        return self._known[1]
