"""Annotators: labels from exact geometry."""

from __future__ import annotations

from abc import abstractmethod

from posse_core._model.labels import Labels, View
from posse_core._model.scene import FrameState, Scene
from posse_core._plugins.component import Component, OptionsT


class Annotator(Component[OptionsT]):
    """Makes one kind of label. It sees geometry, never rendered pixels, so labels are the same to the
    bit whichever renderer is chosen."""

    @abstractmethod
    def annotate(self, scene: Scene, frame: FrameState, view: View) -> Labels:
        """The labels of one frame. The names of arrays must not be another annotator's."""
