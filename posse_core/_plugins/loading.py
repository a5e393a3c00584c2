"""Loading plugins so that a faulty one does not affect the others.

With pluggy alone, loading all entry points stops at the first ImportError, a failed registration leaves
a plugin half registered, and one hook that raises loses the results of all. Therefore each entry point
is loaded on its own and removed again if it fails, and its hooks are called one at a time.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from typing import Any, Literal

import pluggy

from posse_core import __version__
from posse_core._errors import ComponentError
from posse_core._plugins import builtin
from posse_core._plugins import hooks as hookspecs
from posse_core._plugins.kinds import KINDS, Kind, reserved_for
from posse_core._plugins.options import nearest
from posse_core._plugins.registry import API_VERSION, CORE, ComponentSpec, Registry

GROUP = "posse"
State = Literal["ok", "disabled", "broken", "incompatible", "duplicate"]


@dataclass(frozen=True)
class PluginStatus:
    """The state of one plugin after loading."""

    dist: str
    version: str
    name: str
    state: State
    error: str = ""
    components: tuple[str, ...] = ()
    """``"kind:name"`` of each of its components."""


class _Refused(Exception):
    def __init__(self, state: State, reason: str) -> None:
        super().__init__(reason)
        self.state: State = state


class Plugins:
    """All plugins of this process: the registry of their components, and the state of each."""

    def __init__(self, entry_points: Sequence[metadata.EntryPoint]) -> None:
        self.registry = Registry()
        self.statuses: list[PluginStatus] = []
        self._manager = pluggy.PluginManager("posse")
        self._manager.add_hookspecs(hookspecs)
        self._take(builtin, CORE, "posse-core", __version__)
        disabled = _names(os.environ.get("POSSE_DISABLE_PLUGINS", ""))
        for entry_point in sorted(entry_points, key=_by_dist_and_name):
            self._load(entry_point, disabled)
        if os.environ.get("POSSE_STRICT_PLUGINS") == "1":
            for status in self.statuses:
                if status.state not in ("ok", "disabled"):
                    raise ComponentError(
                        f"plugin {status.name!r} of {status.dist} is {status.state}: {status.error}"
                        " (POSSE_STRICT_PLUGINS=1; disable it with POSSE_DISABLE_PLUGINS)"
                    )

    def notify(self, hook: str, **arguments: Any) -> None:
        """Call all observers of ``hook``. An error in one becomes a warning, and the next is called."""
        for implementation in getattr(self._manager.hook, hook).get_hookimpls():
            wanted = {name: arguments[name] for name in implementation.argnames}
            try:
                implementation.function(**wanted)
            except (Exception, SystemExit) as error:  # a third party's observer must not end the run
                warnings.warn(
                    f"{hook} of plugin {implementation.plugin_name!r} raised {_described(error)}",
                    stacklevel=2,
                )

    def _load(self, entry_point: metadata.EntryPoint, disabled: set[str]) -> None:
        dist = entry_point.dist
        dist_name, version = (dist.name, dist.version) if dist else ("?", "?")
        name = entry_point.name
        try:
            if name in disabled or dist_name in disabled:
                raise _Refused("disabled", "named in POSSE_DISABLE_PLUGINS")
            _refuse_reserved("plugin", name, dist_name)
            if self._manager.has_plugin(name):
                other = next(s.dist for s in self.statuses if s.name == name)
                raise _Refused("duplicate", f"{other} already has a plugin of this name")
            try:
                plugin = entry_point.load()
            except (Exception, SystemExit) as error:  # imported third-party code can raise anything
                raise _Refused("broken", _described(error)) from error
            self._take(plugin, name, dist_name, version)
        except _Refused as refusal:
            status = PluginStatus(dist_name, version, name, refusal.state, str(refusal))
            self.statuses.append(status)
            if refusal.state != "duplicate":
                self.registry.broken[name] = f"{refusal.state}: {refusal}"

    def _take(self, plugin: Any, name: str, dist: str, version: str) -> None:
        """Register a plugin and its components, or leave the registry unchanged."""
        try:
            self._manager.register(plugin, name)
            _refuse_wrong_marks(plugin)
        except (Exception, SystemExit) as error:  # a module's __getattr__ can raise anything
            if self._manager.has_plugin(name):
                self._manager.unregister(name=name)
            if isinstance(error, ValueError | pluggy.PluginValidationError):
                raise _Refused("incompatible", " ".join(str(error).split())) from error
            raise _Refused("broken", _described(error)) from error
        try:
            components = self._collect(plugin, dist)
        except _Refused:
            self._manager.unregister(name=name)
            raise
        for kind, spec in components:
            self.registry.add(kind, spec, name)
        listed = tuple(f"{kind}:{spec.name}" for kind, spec in components)
        self.statuses.append(PluginStatus(dist, version, name, "ok", components=listed))

    def _collect(self, plugin: Any, dist: str) -> list[tuple[str, ComponentSpec]]:
        components: list[tuple[str, ComponentSpec]] = []
        taken: set[tuple[str, str]] = set()
        for kind in KINDS.values():
            for implementation in getattr(self._manager.hook, kind.hook).get_hookimpls():
                if implementation.plugin is not plugin:
                    continue
                try:
                    specs = list(implementation.function())
                except (Exception, SystemExit) as error:  # third-party code can raise anything
                    raise _Refused("broken", f"{kind.hook}: {_described(error)}") from error
                for spec in specs:
                    self._check(spec, kind)
                    if (kind.name, spec.name) in taken:
                        raise _Refused("duplicate", f"it names {kind.name} {spec.name!r} twice")
                    self._refuse_taken(kind.name, spec.name, dist)
                    taken.add((kind.name, spec.name))
                    components.append((kind.name, spec))
        return components

    def _refuse_taken(self, kind: str, name: str, dist: str) -> None:
        owner = self.registry.owner(kind, name)
        if owner is not None:
            raise _Refused("duplicate", f"the {kind} name {name!r} is taken by plugin {owner!r}")
        _refuse_reserved(kind, name, dist)

    @staticmethod
    def _check(spec: object, kind: Kind) -> None:
        if not isinstance(spec, ComponentSpec):
            raise _Refused(
                "incompatible", f"{kind.hook} returned {type(spec).__name__}, not ComponentSpec"
            )
        problem = spec.problem()
        if problem:
            raise _Refused("incompatible", f"{kind.hook}: {problem}")
        if spec.api != API_VERSION:
            raise _Refused(
                "incompatible",
                f"{kind.name} {spec.name!r} was written for version {spec.api} of the interfaces, but"
                f" this core has version {API_VERSION}; install matching releases of the two",
            )
        unknown = kind.unknown_capability(spec.capabilities)
        if unknown:
            raise _Refused("incompatible", f"{kind.name} {spec.name!r}: {unknown}")


def _refuse_reserved(kind: str, name: str, dist: str) -> None:
    official = reserved_for(kind, name)
    if official is not None and official != re.sub(r"[-_.]+", "-", dist).lower():
        raise _Refused("duplicate", f"the {kind} name {name!r} is reserved for {official}")


def _refuse_wrong_marks(plugin: Any) -> None:
    """Refuse marked functions that are no hooks, and hooks without a mark; pluggy would ignore them."""
    known = [name for name in vars(hookspecs) if name.startswith("posse_")]
    marked = 0
    for name in dir(plugin):
        function = getattr(plugin, name, None)
        if getattr(function, "posse_impl", None):
            if name not in known:
                raise ValueError(f"there is no hook named {name!r}{nearest(name, known)}")
            marked += 1
        elif name in known and callable(function):
            raise ValueError(f"its function {name!r} is not marked with @posse_core.hookimpl")
    if not marked:
        raise ValueError(
            "it has no function marked with @posse_core.hookimpl, such as posse_renderers"
            " (docs/plugins.md lists all)"
        )


def _described(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}"


def _by_dist_and_name(entry_point: metadata.EntryPoint) -> tuple[str, str]:
    return (entry_point.dist.name if entry_point.dist else "", entry_point.name)


def _names(text: str) -> set[str]:
    return {part.strip() for part in text.split(",") if part.strip()}


@cache
def load_plugins() -> Plugins:
    """Load the plugins of this process once, and return them."""
    return Plugins(tuple(metadata.entry_points(group=GROUP)))
