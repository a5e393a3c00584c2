"""Scene sources: spacecraft by name."""

from __future__ import annotations

from abc import abstractmethod

from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.component import Component, OptionsT


class SceneSource(Component[OptionsT]):
    """Makes a spacecraft. The same options give the same spacecraft to the bit."""

    @abstractmethod
    def build(self) -> Spacecraft:
        """The spacecraft, in metres, its origin at the centre of mass.

        Raises:
            posse_core.InputError: a file that the options name cannot be used.
        """
