"""Options of components, which are pydantic models without unknown keys, and their error messages."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from posse_core._errors import InputError


class Options(BaseModel):
    """Base class of options: frozen, without unknown keys, NaN and infinity."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class NoOptions(Options):
    """The options of a component that has none."""


ModelT = TypeVar("ModelT", bound=BaseModel)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint such as ``; did you mean 'spp'?``, or an empty string if no name is similar."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else ""


def validated(
    model: type[ModelT],
    raw: Mapping[str, Any] | bytes,
    where: Callable[[tuple[int | str, ...]], str],
) -> ModelT:
    """Validate ``raw``, a mapping or JSON, by ``model``.

    ``where`` converts the path of a key, such as ``("orbit", "tle")``, to text for the message, such as
    "s.yaml, line 3: orbit.tle".

    Raises:
        InputError: A value is wrong; the message is one line about the first fault and its remedy.
    """
    try:
        if isinstance(raw, bytes):
            return model.model_validate_json(raw)
        return model.model_validate(raw)
    except ValidationError as error:
        raise InputError(_explain(model, error, where)) from None


def _explain(
    model: type[BaseModel],
    error: ValidationError,
    where: Callable[[tuple[int | str, ...]], str],
) -> str:
    # An unknown key is reported first, since it is often the cause of the other faults.
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = tuple(first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        others = f"; known keys are {', '.join(known)}" if known else "; no keys are known here"
        return f"{where(path)}: unknown key{nearest(str(path[-1]), known) or others}"
    if first["type"] == "missing":
        return f"{where(path)}: missing; add it"
    value = first.get("input")
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if isinstance(value, Mapping | BaseModel) or first["type"] == "json_invalid":
        return f"{where(path)}: {message}"
    return f"{where(path)}: {message} (it is {_short(value)})"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """Return the keys that the model at ``path`` inside ``model`` accepts."""
    models = [model]
    for step in path:
        fields = [m.model_fields[str(step)] for m in models if str(step) in m.model_fields]
        if fields:
            models = [inner for field in fields for inner in _models_in(field.annotation)] or models
        else:  # pydantic includes the tag that selects a member of a union in the path
            models = [
                m for m in models if step in (f.default for f in m.model_fields.values())
            ] or models
    return list(dict.fromkeys(f.alias or key for m in models for key, f in m.model_fields.items()))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for argument in getattr(annotation, "__args__", ()) for m in _models_in(argument)]
