"""The base class of every component: it is made from its options, and keeps them."""

from __future__ import annotations

from abc import ABC
from typing import Any, Generic

from pydantic import BaseModel
from typing_extensions import TypeVar

OptionsT = TypeVar("OptionsT", bound=BaseModel, default=Any)
"""The options of a component. A subclass that names none, such as ``class Grey(Renderer)``, has options
of any type."""


class Component(ABC, Generic[OptionsT]):
    """What the interfaces of all kinds share.

    A component declares the type of its options where it names its interface, so that type checkers
    know ``self.options``::

        class WireRenderer(Renderer[WireOptions]): ...

    Attributes:
        options: as the user gave them, checked against the model that the component's record names.
    """

    def __init__(self, options: OptionsT) -> None:
        self.options = options
