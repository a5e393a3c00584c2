"""Scene sources: spacecraft by name."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pydantic import BaseModel

from posse_core._model.spacecraft import Spacecraft


class SceneSource(ABC):
    """Makes a spacecraft. The same options give the same spacecraft to the bit."""

    def __init__(self, options: BaseModel) -> None:
        self.options = options

    @abstractmethod
    def build(self) -> Spacecraft:
        """The spacecraft, in metres, its origin at the centre of mass.

        Raises:
            posse_core._errors.InputError: a file that the options name cannot be used.
        """
