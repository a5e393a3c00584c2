"""Interface of annotators, which make labels from exact geometry."""

from __future__ import annotations

from abc import abstractmethod

from posse_core._interfaces.look import Look
from posse_core._model.labels import Labels
from posse_core._plugins.component import Component, OptionsT


class Annotator(Component[OptionsT]):
    """Makes one kind of label.

    A look gives geometry and never rendered pixels, so labels are equal to the bit for any renderer.
    """

    @abstractmethod
    def annotate(self, look: Look) -> Labels:
        """Return the labels of one frame, as the chaser's camera or a camera beside it looks at it.

        Arrays cover the box of ``look.view()``; their names must differ from those of other
        annotators.
        """
