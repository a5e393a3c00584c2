"""What a shell is offered for the values of arguments and options; quick to import."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._cli.keys import Key, KeyTable

Item = CompletionItem[str]
Completer = Callable[[click.Context, click.Parameter, str], list[Item]]


def components(kind: str, capability: str | None = None) -> Completer:
    """Names of components of a kind, with a capability if one is given."""

    def complete(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
        specs = load_plugins().registry.specs(kind)
        able = (s for s in specs if capability is None or capability in s.capabilities)
        return _starting(incomplete, {spec.name: spec.summary for spec in able})

    return complete


def renderers_by_commas(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Names of renderers, of which several are separated by commas."""
    given, comma, _ = incomplete.rpartition(",")
    specs = load_plugins().registry.specs("renderer")
    rest = {s.name: s.summary for s in specs if s.name not in given.split(",")}
    return _starting(incomplete, {f"{given}{comma}{name}": about for name, about in rest.items()})


def scenarios(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Names of built-in scenarios, and files."""
    from posse_core._scenario.built_in_names import built_in_names

    return [*_starting(incomplete, dict.fromkeys(built_in_names(), "")), _files(incomplete)]


def crafts(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Names of built-in spacecraft, and files and folders."""
    specs = load_plugins().registry.specs("scene")
    built_in = {s.name: s.summary for s in specs if s.name not in ("mesh", "package")}
    return [*_starting(incomplete, built_in), _files(incomplete)]


def cameras(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Names of published cameras, and files."""
    from posse_core._scenario.presets import PRESETS

    known = {name: preset.source for name, preset in PRESETS.items()}
    return [*_starting(incomplete, known), _files(incomplete)]


def crosscheck_cases(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Closed forms, names of built-in scenarios, and files."""
    forms = _starting(incomplete, dict.fromkeys(_table().closed_forms, "a closed form"))
    return [*forms, *scenarios(ctx, parameter, incomplete)]


def folders(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Folders."""
    return [CompletionItem(incomplete, type="dir")]


def words(known: Mapping[str, str]) -> Completer:
    """Words that are known, each with a line about it."""
    return lambda ctx, parameter, incomplete: _starting(incomplete, known)


def described_kinds(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """What ``posse describe`` describes."""
    kinds = {kind.name: kind.summary for kind in KINDS.values()}
    others = {
        "scenario": "every key",
        "recipe": "every key",
        "track": "keys of 'posse track'",
        "camera": "a named camera",
    }
    return _starting(incomplete, {**others, **kinds})


def described_names(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """Names of what ``posse describe KIND`` describes."""
    kind = str(ctx.params.get("kind"))
    if kind == "camera":
        from posse_core._scenario.presets import PRESETS

        return _starting(incomplete, {name: preset.source for name, preset in PRESETS.items()})
    return components(kind)(ctx, parameter, incomplete) if kind in KINDS else []


def scenario_keys(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """``KEY=VALUE`` of a scenario."""
    table = _table()
    return _overrides(table.scenario, table, ctx, incomplete)


def track_keys(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """``KEY=VALUE`` of ``posse track``."""
    table = _table()
    return _overrides(table.track, table, ctx, incomplete)


def model_keys(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """``KEY=VALUE`` of the options of detectors: of the one that ``--detector`` names, or of all."""
    table = _table()
    known = table.components["detector"]
    keys = _options(known, ctx.params.get("detector"))
    return _overrides(keys, table, ctx, incomplete)


def crosscheck_keys(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """``KEY=VALUE`` of a scenario, and ``RENDERER.KEY=VALUE``."""
    from posse_core._cli.keys import Key

    table = _table()
    keys = {key: known for key, known in table.scenario.items() if key != "renderer"}
    for name, options in table.components["renderer"].items():
        keys[name] = Key(about=f"options of the renderer {name}", keys=options)
    return _overrides(keys, table, ctx, incomplete)


def export_keys(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> list[Item]:
    """``FORMAT.KEY=VALUE``: of the formats that ``--format`` names, or of all."""
    from posse_core._cli.keys import Key

    table = _table()
    formats = ctx.params.get("formats") or table.components["writer"]
    keys = {
        name: Key(about=f"options of the format {name}", keys=options)
        for name, options in table.components["writer"].items()
        if name in formats and options
    }
    return _overrides(keys, table, ctx, incomplete)


def _table() -> KeyTable:
    from posse_core._cli.keys import key_table

    return key_table(load_plugins())


def _overrides(
    keys: Mapping[str, Key], table: KeyTable, ctx: click.Context, incomplete: str
) -> list[Item]:
    """Keys or values that ``incomplete``, such as ``renderer.v`` or ``renderer.name=m``, may become."""
    path, equals, _ = incomplete.partition("=")
    *parents, last = path.split(".")
    for depth, step in enumerate(parents):
        if step not in keys:
            return []
        keys = _within(keys[step], table, _named(ctx, tuple(parents[: depth + 1]), keys[step]))
    if equals:
        if last not in keys:
            return []
        return _starting(incomplete, {f"{path}={value}": "" for value in _values(keys[last], table)})
    before = "".join(f"{step}." for step in parents)
    offered = {}
    for name, key in keys.items():
        if key.keys or key.kind:
            offered[f"{before}{name}."] = key.about
        if key.kind or not key.keys:
            offered[f"{before}{name}="] = key.about
    return _starting(incomplete, offered)


def _within(key: Key, table: KeyTable, named: str | None) -> Mapping[str, Key]:
    """The keys within one, which for a component are its name and its options."""
    if not key.kind:
        return key.keys
    known = table.components.get(key.kind, {})
    from posse_core._cli.keys import Key

    name = Key(about=f"name of the {key.kind}", values=tuple(known))
    return {key.name_key: name, **_options(known, named)}


def _options(known: Mapping[str, Mapping[str, Key]], named: str | None) -> Mapping[str, Key]:
    """The options of the component that is named, or of all."""
    from posse_core._cli.keys import merged

    return known[named] if named is not None and named in known else merged(known.values())


def _values(key: Key, table: KeyTable) -> Iterable[str]:
    return table.components.get(key.kind, {}) if key.kind else key.values


def _named(ctx: click.Context, path: tuple[str, ...], key: Key) -> str | None:
    """The component that the command line chooses by a key, if it does."""
    if path == ("renderer",) and ctx.params.get("renderer"):
        return str(ctx.params["renderer"])
    written = ".".join(path)
    for override in reversed(ctx.params.get("overrides") or ()):
        given, _, value = str(override).partition("=")
        if given in (written, f"{written}.{key.name_key}"):
            return value
    return None


def _starting(incomplete: str, known: Mapping[str, str]) -> list[Item]:
    return [
        CompletionItem(word, help=" ".join(about.split()) or None)
        for word, about in known.items()
        if word.startswith(incomplete)
    ]


def _files(incomplete: str) -> Item:
    return CompletionItem(incomplete, type="file")
