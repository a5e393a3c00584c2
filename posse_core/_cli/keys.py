"""The keys that ``-o`` takes, and names that are slow to import, for shells that complete them.

To import the models of all keys takes a second, so what is known of them is kept in the user's cache
until a file that they come from changes, or other plugins are installed.
"""

from __future__ import annotations

import contextlib
import hashlib
import sys
import types
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from posse_core._errors import PosseError
from posse_core._files.atomic import write_bytes
from posse_core._files.cache_folder import cache_folder
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import Plugins

_KIND_OF: Final = {"target": "scene", "correction": "renderer"}
"""Key that chooses a component → its kind, where the key is not named like the kind."""


class Key(BaseModel):
    """A key of a scenario or of a component.

    Attributes:
        about: its description.
        values: those that are known; empty where any number or text may be one.
        keys: the keys within.
        kind: of the component that it chooses, whose options are keys within; empty if it chooses none.
        name_key: key within that names this component.
    """

    model_config = ConfigDict(frozen=True)

    about: str = ""
    values: tuple[str, ...] = ()
    keys: Mapping[str, Key] = {}
    kind: str = ""
    name_key: str = ""


class KeyTable(BaseModel):
    """All keys.

    Attributes:
        plugins: distribution and version of each plugin.
        files: file from which keys were read → when it was last changed, ns.
        scenario, track: the keys of a scenario, and those of ``posse track``.
        closed_forms: names of the scenes of ``posse crosscheck`` whose light is known in closed form.
        components: kind → name → the options' keys. Those that cannot be imported are absent.
    """

    model_config = ConfigDict(frozen=True)

    plugins: tuple[str, ...]
    files: Mapping[str, int]
    scenario: Mapping[str, Key]
    track: Mapping[str, Key]
    closed_forms: tuple[str, ...]
    components: Mapping[str, Mapping[str, Mapping[str, Key]]]


def key_table(plugins: Plugins) -> KeyTable:
    """Return the keys of what is installed, from the cache if it has them."""
    place = hashlib.sha256(f"{sys.prefix} {__file__}".encode()).hexdigest()[:16]
    path = cache_folder() / f"keys-{place}.json"
    with contextlib.suppress(OSError, ValidationError):
        kept = KeyTable.model_validate_json(path.read_bytes())
        if kept.plugins == _named(plugins) and all(
            Path(file).stat().st_mtime_ns == changed for file, changed in kept.files.items()
        ):
            return kept
    table = _made(plugins)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, table.model_dump_json(exclude_defaults=True).encode())
    return table


def _named(plugins: Plugins) -> tuple[str, ...]:
    return tuple(f"{status.dist} {status.version} {status.state}" for status in plugins.statuses)


def _made(plugins: Plugins) -> KeyTable:
    from posse_core._evaluation.crosscheck import closed_forms
    from posse_core._scenario.model import Scenario
    from posse_core._scenario.track import TrackConfig

    components: dict[str, dict[str, Mapping[str, Key]]] = {}
    sources = {__file__, closed_forms.__file__}
    scenario, track = _keys(Scenario, sources), _keys(TrackConfig, sources)
    for kind in KINDS:
        for name in plugins.registry.names(kind) if kind != "subcommand" else ():
            with contextlib.suppress(PosseError):
                model = plugins.registry.options_model(kind, name)
                components.setdefault(kind, {})[name] = _keys(model, sources)
    return KeyTable(
        plugins=_named(plugins),
        files={file: Path(file).stat().st_mtime_ns for file in sorted(sources)},
        scenario=scenario,
        track=track,
        closed_forms=tuple(closed_forms.CLOSED_FORMS),
        components=components,
    )


def _keys(model: type[BaseModel], sources: set[str]) -> dict[str, Key]:
    """The keys of a model; the files of its module and of those within are added to ``sources``."""
    from posse_core._scenario.component import ComponentChoice

    file = sys.modules[model.__module__].__file__
    if file is not None:
        sources.add(file)
    keys = {}
    for name, field in model.model_fields.items():
        members = tuple(_members(field.annotation))
        models = [m for m in members if isinstance(m, type) and issubclass(m, BaseModel)]
        about = field.description or ""
        chosen = next((m for m in models if issubclass(m, ComponentChoice)), None)
        if chosen is not None:
            kind = "attitude-law" if chosen.key() == "law" else _KIND_OF.get(name, name)
            keys[name] = Key(about=about, kind=kind, name_key=chosen.key())
            continue
        inner = merged(_keys(part, sources) for part in models)
        keys[field.alias or name] = Key(
            about=about,
            values=(*_values(members), *(str(example) for example in field.examples or ())),
            keys=inner,
        )
    return keys


def merged(groups: Iterable[Mapping[str, Key]]) -> dict[str, Key]:
    """The keys of several models, of which any may be the one that is meant."""
    found: dict[str, Key] = {}
    for group in groups:
        for name, key in group.items():
            former = found.get(name, key)
            values = tuple(dict.fromkeys((*former.values, *key.values)))
            found[name] = former.model_copy(
                update={
                    "values": values,
                    "keys": merged((former.keys, key.keys)) if key.keys else former.keys,
                }
            )
    return found


def _members(annotation: Any) -> Iterator[Any]:
    """The types that a value may be of; items of a list or a mapping are no values of the key."""
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        for part in get_args(annotation):
            yield from _members(part)
    elif hasattr(annotation, "__metadata__"):  # Annotated
        yield from _members(get_args(annotation)[0])
    else:
        yield annotation


def _values(members: tuple[Any, ...]) -> Iterator[str]:
    for member in members:
        if member is bool:
            yield from ("true", "false")
        elif get_origin(member) is Literal:
            yield from (str(value) for value in get_args(member))
