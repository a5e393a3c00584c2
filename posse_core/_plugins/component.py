"""The base class of every component: it is made from its options, and keeps them."""

from __future__ import annotations

import contextlib
from abc import ABC
from collections.abc import Iterator
from typing import Any, Generic

from pydantic import BaseModel
from typing_extensions import TypeVar

from posse_core._errors import ComponentError, PosseError

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


@contextlib.contextmanager
def failures_named(kind: str, name: str) -> Iterator[None]:
    """Name the component whose code runs in the block in any error that is not meant for the user.

    Errors of POSSE and of the system (a full disk) pass as they are.
    """
    try:
        yield
    except (PosseError, OSError):
        raise
    except Exception as error:  # any code of a third party
        text = " ".join(str(error).split())
        raise ComponentError(f"{kind} {name!r} failed: {type(error).__name__}: {text}") from error
