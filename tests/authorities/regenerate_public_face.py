"""Record the public face: every public name of posse_core with its signature, one a line.

    python tests/authorities/regenerate_public_face.py

writes ``public_face.txt`` anew. Its difference in a review is what changes for those who build on POSSE.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType, GenericAlias, ModuleType
from typing import Any

from pydantic import BaseModel

import posse_core

RECORD = Path(__file__).with_name("public_face.txt")


class _Text(str):
    """An annotation as it is written."""

    __repr__ = str.__str__


def face() -> str:
    """The public face as text."""
    return "\n".join([*_names(posse_core, "posse_core"), ""])


def _names(module: ModuleType, path: str) -> Iterator[str]:
    for name in sorted(module.__all__):
        yield from _described(getattr(module, name), f"{path}.{name}")


def _described(value: object, path: str) -> Iterator[str]:
    if isinstance(value, ModuleType):
        yield f"{path}: module"
        yield from _names(value, path)
    elif isinstance(value, type) and not isinstance(value, GenericAlias):
        yield from _class(value, path)
    elif isinstance(value, FunctionType):
        yield f"{path}{_signature(value)}"
    else:
        yield f"{path}: {'type' if isinstance(value, GenericAlias) else type(value).__name__}"


def _class(cls: type, path: str) -> Iterator[str]:
    known = {getattr(posse_core, name) for name in posse_core.__all__ if _is_class(name)}
    # what a class takes from private bases is its own to its users
    own = [base for base in cls.__mro__ if _is_ours(base) and (base is cls or base not in known)]
    public_bases = [base.__name__ for base in cls.__mro__[1:] if base in known]
    outer = [base.__name__ for base in cls.__bases__ if not _is_ours(base) and base is not object]
    yield f"{path}: class({', '.join([*public_bases, *outer])})"
    fields: set[str] = set()
    if dataclasses.is_dataclass(cls):
        fields = {field.name for field in dataclasses.fields(cls)}
        yield f"{path}{_signature(cls)}"
    elif issubclass(cls, BaseModel):
        fields = set(cls.model_fields)
        for name, field in cls.model_fields.items():
            default = field.get_default(call_default_factory=True)
            end = "" if field.is_required() else f" = {default!r}"
            yield f"{path}.{name}: {_annotation(cls, name)}{end}"
    elif any("__init__" in vars(base) for base in own) and not getattr(cls, "_is_protocol", False):
        yield f"{path}{_signature(cls)}"
    for name in sorted({name for base in own for name in (*vars(base), *_annotations(base))} - fields):
        if not name.startswith("_") and name != "model_config":
            yield from _member(cls, name, f"{path}.{name}")


def _member(cls: type, name: str, path: str) -> Iterator[str]:
    value = inspect.getattr_static(cls, name, None)
    marks = ["abstract "] if getattr(value, "__isabstractmethod__", False) else []
    if isinstance(value, property | functools.cached_property):
        getter: Any = value.fget if isinstance(value, property) else value.func
        yield f"{path}: {''.join(marks)}property {getter.__annotations__.get('return', '')}"
    elif isinstance(value, classmethod | staticmethod):
        yield f"{path}{_signature(value.__func__)} [{''.join(marks)}{type(value).__name__}]"
    elif isinstance(value, FunctionType):
        yield f"{path}{_signature(value)}{' [abstract]' if marks else ''}"
    else:
        annotation, default = _annotation(cls, name), "" if value is None else f" = {value!r}"
        yield f"{path}: {annotation or type(value).__name__}{default}"


def _is_class(name: str) -> bool:
    return isinstance(getattr(posse_core, name), type)


def _is_ours(cls: type) -> bool:
    return cls.__module__.partition(".")[0] == "posse_core"


def _annotations(cls: type) -> dict[str, Any]:
    return dict(vars(cls).get("__annotations__", {}))


def _annotation(cls: type, name: str) -> str:
    return next((str(_annotations(c)[name]) for c in cls.__mro__ if name in _annotations(c)), "")


def _signature(of: Callable[..., Any]) -> str:
    signature = inspect.signature(of)
    parameters = [
        parameter.replace(annotation=_written(parameter.annotation))
        for parameter in signature.parameters.values()
    ]
    result = _written(signature.return_annotation)
    text = str(signature.replace(parameters=parameters, return_annotation=result))
    return " ".join(text.split())  # an array that is a default is written on several lines


def _written(annotation: object) -> object:
    return _Text(annotation) if isinstance(annotation, str) else annotation


if __name__ == "__main__":
    RECORD.write_text(face(), encoding="utf-8")
