"""Options of components, which are pydantic models without unknown keys, and their error messages."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from posse_core._errors import InputError


class Options(BaseModel):
    """Base class of options: frozen, without unknown keys, NaN and infinity."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class NoOptions(Options):
    """The options of a component that has none."""


ModelT = TypeVar("ModelT", bound=BaseModel)
_MEMBER = re.compile(r"(tuple|list|dict)?\[")
"""How pydantic names a member of a union by its type, or by a tag that begins so."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint such as ``; did you mean 'spp'?``, or an empty string if no name is similar."""
    close = closest(name, known)
    return "" if close is None else f"; did you mean {close!r}?"


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the most similar of the known names, or None if none is similar."""
    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)), None)


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
    location, context = tuple(first["loc"]), first.get("ctx", {})
    if first["type"] == "extra_forbidden":
        path, models = _located(model, location[:-1])
        known = list(dict.fromkeys(f.alias or key for m in models for key, f in m.model_fields.items()))
        others = f"; known keys are {', '.join(known)}" if known else "; no keys are known here"
        key = location[-1]
        return f"{where((*path, key))}: unknown key{nearest(str(key), known) or others}"
    path, models = _located(model, location)
    if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
        key = str(context["discriminator"]).strip("'")
        tags = [tag for m in models for name, tag in _tags(m).items() if name == key]
        if "tag" not in context:
            return f"{where((*path, key))}: missing; give one of {', '.join(tags)}"
        hint = nearest(str(context["tag"]), tags) or f"; known are {', '.join(tags)}"
        return f"{where((*path, key))}: there is no {context['tag']!r}{hint}"
    if first["type"] == "missing":
        return f"{where(path)}: missing; add it"
    value = first.get("input")
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if first["type"] in ("dict_type", "model_attributes_type", "model_type"):
        message = "input should be a mapping of keys to values"
    if first["type"] == "path_type":
        message = "input should be a path"
    if isinstance(value, Mapping | BaseModel) or first["type"] == "json_invalid":
        return f"{where(path)}: {message}"
    hint = ""
    if first["type"] == "literal_error" and isinstance(value, str):
        hint = nearest(value, re.findall(r"'([^']*)'", str(context["expected"])))
    return f"{where(path)}: {message} (it is {_short(value)}){hint}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _located(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> tuple[tuple[int | str, ...], list[type[BaseModel]]]:
    """The path of keys that pydantic's location means inside ``model``, and the models that may be
    there.

    A location also names the members of unions, by their tags or types; those are no keys.
    """
    models, path = [model], list[int | str]()
    is_value = False
    for step in location:
        fields = [m.model_fields[str(step)] for m in models if str(step) in m.model_fields]
        tagged = [m for m in models if step in _tags(m).values()]
        if fields:
            models = [inner for field in fields for inner in _models_in(field.annotation)]
            is_value = not models and not any(_has_keys(field.annotation) for field in fields)
        elif tagged:
            models = tagged
            continue
        elif isinstance(step, str) and (is_value or _MEMBER.match(step)):
            continue
        path.append(step)
    return tuple(path), models


def _tags(model: type[BaseModel]) -> dict[str, str]:
    """The keys of a model that can have one value only, by which a union selects it, and this value."""
    return {
        key: str(get_args(field.annotation)[0])
        for key, field in model.model_fields.items()
        if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
    }


def _has_keys(annotation: Any) -> bool:
    """Whether a value of this type may be a mapping, whose keys are the user's own."""
    if isinstance(get_origin(annotation), type) and issubclass(get_origin(annotation), Mapping):
        return True
    return any(_has_keys(argument) for argument in get_args(annotation))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for argument in getattr(annotation, "__args__", ()) for m in _models_in(argument)]
