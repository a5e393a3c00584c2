"""The base class of all components, which are made from their options."""

from __future__ import annotations

import contextlib
from abc import ABC
from collections.abc import Iterator
from typing import Any, Generic

from pydantic import BaseModel
from typing_extensions import TypeVar

from posse_core._errors import ComponentError, PosseError

OptionsT = TypeVar("OptionsT", bound=BaseModel, default=Any)
"""The type of a component's options; a class without it, such as ``class Grey(Renderer)``, takes any."""


class Component(ABC, Generic[OptionsT]):
    """The base class of all interfaces.

    A component gives the type of its options as the argument of its interface, so that type checkers
    know the type of ``self.options``::

        class WireRenderer(Renderer[WireOptions]): ...

    Attributes:
        options: the user's options, validated by the model that the component's record names.
    """

    def __init__(self, options: OptionsT) -> None:
        self.options = options


@contextlib.contextmanager
def failures_named(kind: str, name: str) -> Iterator[None]:
    """Turn unexpected errors in the block into a ComponentError that names the component.

    Errors of POSSE and of the operating system, such as a full disk, pass unchanged.
    """
    try:
        yield
    except (PosseError, OSError):
        raise
    except Exception as error:  # third-party code can raise anything
        text = " ".join(str(error).split())
        raise ComponentError(f"{kind} {name!r} failed: {type(error).__name__}: {text}") from error
