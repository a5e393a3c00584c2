"""Annotators: labels from exact geometry."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pydantic import BaseModel

from posse_core._model.labels import Labels, View
from posse_core._model.scene import FrameState, Scene


class Annotator(ABC):
    """Makes one kind of label. It sees geometry, never rendered pixels, so labels are the same to the
    bit whichever renderer is chosen."""

    def __init__(self, options: BaseModel) -> None:
        self.options = options

    @abstractmethod
    def annotate(self, scene: Scene, frame: FrameState, view: View) -> Labels:
        """The labels of one frame. Keys must not clash with another annotator's."""
