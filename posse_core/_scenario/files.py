"""The files that a scenario names: each ``Path`` in its keys or in the options of a component."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from posse_core._errors import InputError
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.yaml_lines import KeyPath

ModelT = TypeVar("ModelT", bound=BaseModel)


def keys_of(options: BaseModel) -> dict[str, Any]:
    """The options of a component as JSON has them, but with each ``Path`` left as it is."""
    keys: dict[str, Any] = _with_paths(options.model_dump(mode="json"), options.model_dump())
    return keys


def _with_paths(plain: Any, dumped: Any) -> Any:
    if isinstance(dumped, Path):
        return dumped
    if isinstance(plain, dict) and isinstance(dumped, Mapping):
        return {key: _with_paths(value, dumped.get(key)) for key, value in plain.items()}
    if isinstance(plain, list) and isinstance(dumped, list | tuple):
        return [_with_paths(*pair) for pair in zip(plain, dumped, strict=True)]
    return plain


def with_files(record: ModelT, change: Callable[[KeyPath, Path], Path]) -> ModelT:
    """A scenario, or the options of a component, with other paths.

    Args:
        record: the options of a scenario's components are as by :func:`keys_of`.
        change: gives the new path of a key, from the keys that lead to it and the path it has.
    """
    changed: ModelT = _changed(record, (), change)
    return changed


def _changed(value: Any, key: KeyPath, change: Callable[[KeyPath, Path], Path]) -> Any:
    """The value with its paths changed; the same object where it has none."""
    if isinstance(value, Path):
        return change(key, value)
    if isinstance(value, BaseModel):
        pairs: list[tuple[Any, Any]] = list(value)
    elif isinstance(value, Mapping):
        pairs = list(value.items())
    elif isinstance(value, list | tuple):
        pairs = list(enumerate(value))
    else:
        return value
    update = {}
    for name, inner in pairs:
        # In a scenario, a component's options stand beside its name.
        beside = isinstance(value, ComponentChoice) and name == "options"
        new = _changed(inner, key if beside else (*key, name), change)
        if new is not inner:
            update[name] = new
    if not update:
        return value
    if isinstance(value, BaseModel):
        return value.model_copy(update=update)
    if isinstance(value, Mapping):
        return {**value, **update}
    return type(value)(update.get(i, inner) for i, inner in enumerate(value))


def anchored(path: Path, base: Path, where: str, *, confined: bool) -> Path:
    """The absolute path of a file that is named relative to a folder.

    Args:
        path: as it was given.
        base: the folder.
        where: the key that names the file, for messages.
        confined: a relative path must not leave the folder, even by links.

    Raises:
        InputError: it does.
    """
    whole = (base / path).absolute()
    if confined and not path.is_absolute() and not is_within(whole, base):
        raise InputError(
            f"{where}: {str(path)!r} leads out of {base}, and a dataset's files are within its folder;"
            " put the file there, or name it by an absolute path if you trust it"
        )
    return whole


def is_within(path: Path, folder: Path) -> bool:
    """Say whether a path is in a folder when links are followed."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
