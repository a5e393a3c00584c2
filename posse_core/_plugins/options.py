"""Options of components: pydantic models that forbid unknown keys, and how their errors are told."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from posse_core._errors import InputError


class Options(BaseModel):
    """Base of every component's options: frozen, unknown keys forbidden, NaN and infinity refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class NoOptions(Options):
    """For a component without options."""


ModelT = TypeVar("ModelT", bound=BaseModel)


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint such as ``; did you mean 'spp'?``, or the empty string when nothing is near."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else ""


def validated(
    model: type[ModelT],
    raw: Mapping[str, Any],
    where: Callable[[tuple[int | str, ...]], str],
) -> ModelT:
    """Check ``raw`` against ``model``.

    ``where`` turns the path of a key, such as ``("orbit", "tle")``, into words for the message
    ("s.yaml, line 3: orbit.tle").

    Raises:
        InputError: one line for the first thing that is wrong, with the way out.
    """
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        raise InputError(_explain(model, raw, error, where)) from None


def _explain(
    model: type[BaseModel],
    raw: Mapping[str, Any],
    error: ValidationError,
    where: Callable[[tuple[int | str, ...]], str],
) -> str:
    # An unknown key is the likelier cause of whatever else is wrong beside it.
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = tuple(first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        hint = nearest(str(path[-1]), known)
        return f"{where(path)}: unknown key{hint or '; known keys are ' + ', '.join(known)}"
    if first["type"] == "missing":
        return f"{where(path)}: missing; add it"
    value = first.get("input")
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    shown = "" if isinstance(value, Mapping | BaseModel) else f" (it is {_short(value)})"
    return f"{where(path)}: {message}{shown}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """Keys that the model at ``path`` below ``model`` accepts."""
    models = [model]
    for step in path:
        fields = [m.model_fields[str(step)] for m in models if str(step) in m.model_fields]
        if fields:
            models = [inner for field in fields for inner in _models_in(field.annotation)] or models
        else:  # pydantic puts the tag that chose a member of a union into the path
            models = [
                m for m in models if step in (f.default for f in m.model_fields.values())
            ] or models
    return list(dict.fromkeys(key for m in models for key in m.model_fields))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for argument in getattr(annotation, "__args__", ()) for m in _models_in(argument)]
