"""Interface of annotators, which make labels from exact geometry."""

from __future__ import annotations

from abc import abstractmethod

from posse_core._model.labels import Labels, View
from posse_core._model.scene import FrameState, Scene
from posse_core._plugins.component import Component, OptionsT


class Annotator(Component[OptionsT]):
    """Makes one kind of label.

    An annotator sees geometry and never rendered pixels, so labels are equal to the bit for any
    renderer.
    """

    @abstractmethod
    def annotate(self, scene: Scene, frame: FrameState, view: View) -> Labels:
        """Return the labels of one frame. Names of arrays must differ from those of other annotators."""
