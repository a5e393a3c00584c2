"""Components by kind and name: records that plugins hand in, and how one is made from its record.

A record names its class by a string, ``"module:Class"``, which is imported when the component is
first made. So listing what is installed imports no renderer and no deep-learning library.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import BaseModel

from posse_core._errors import ComponentError, InputError
from posse_core._plugins.options import nearest, validated

API_VERSION: Final = 1
"""Version of the interfaces in :mod:`posse_core._interfaces`; a record of another one is refused."""

KINDS: Final = (
    "propagator",
    "scene",
    "renderer",
    "annotator",
    "detector",
    "writer",
    "executor",
    "subcommand",
)

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]*")
_TARGET = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


@dataclass(frozen=True)
class ComponentSpec:
    """What a plugin says of one component.

    Attributes:
        name: what the user writes (``--renderer mitsuba``); lower case, digits, ``.``, ``_``, ``-``.
        summary: one line for ``posse plugins`` and ``posse describe``.
        factory: ``"module:Class"``; the class is called with one argument, its options. For a
            subcommand it is a :class:`click.Command`.
        options: ``"module:Model"``, a subclass of :class:`posse_core.Options`. Its module must be cheap
            to import.
        capabilities: words that the core asks for, documented with each interface.
        api: the :data:`API_VERSION` that the component was written for.
    """

    name: str
    summary: str
    factory: str
    options: str = "posse_core._plugins.options:NoOptions"
    capabilities: frozenset[str] = frozenset()
    api: int = API_VERSION

    def problem(self) -> str | None:
        """What is wrong with this record, or None."""
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            return f"the name {self.name!r} is not lower-case letters, digits, '.', '_', '-'"
        for key in ("factory", "options"):
            if not _TARGET.fullmatch(str(getattr(self, key))):
                return f"{key} of {self.name!r} is not of the form 'module:Name'"
        return None


@dataclass
class Registry:
    """Records by kind and name, each with the plugin that it came from."""

    _specs: dict[str, dict[str, tuple[ComponentSpec, str]]] = field(
        default_factory=lambda: {kind: {} for kind in KINDS}
    )
    broken: dict[str, str] = field(default_factory=dict)
    """Cause by name of each plugin that could not be loaded: quoted when a name is not found."""

    def add(self, kind: str, spec: ComponentSpec, plugin: str) -> None:
        """Enter a record; the caller has made sure that the name is free."""
        self._specs[kind][spec.name] = (spec, plugin)

    def owner(self, kind: str, name: str) -> str | None:
        """The plugin that a component came from, or None if there is no such component."""
        entry = self._specs[kind].get(name)
        return entry[1] if entry else None

    def specs(self, kind: str) -> Iterator[ComponentSpec]:
        """All records of a kind, by name."""
        for name in sorted(self._specs[kind]):
            yield self._specs[kind][name][0]

    def names(self, kind: str) -> list[str]:
        """The names of a kind, sorted."""
        return sorted(self._specs[kind])

    def spec(self, kind: str, name: str) -> ComponentSpec:
        """The record of a component.

        Raises:
            InputError: no such name; the message has the nearest one, what is installed, and the
                cause where a broken plugin may have been meant.
        """
        entry = self._specs[kind].get(name)
        if entry is not None:
            return entry[0]
        names = self.names(kind)
        message = f"no {kind} named {name!r}{nearest(name, names) or '.'}"
        message += f" Installed: {', '.join(names)}." if names else " None is installed."
        for plugin, cause in self.broken.items():
            if re.search(rf"(^|[_.-]){re.escape(name)}($|[_.-])", plugin):
                message += f" The plugin {plugin!r} was not loaded: {cause}."
        raise InputError(message)

    def options_model(self, kind: str, name: str) -> type[BaseModel]:
        """The pydantic model of a component's options."""
        spec = self.spec(kind, name)
        model = _import(spec.options, f"the options of {kind} {name!r}")
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            raise ComponentError(f"{spec.options} of {kind} {name!r} is not a pydantic model")
        return model

    def options(
        self, kind: str, name: str, raw: Mapping[str, Any], where: str | None = None
    ) -> BaseModel:
        """Check options given by the user.

        Args:
            raw: key → value, without ``name``.
            where: how the message names the place; ``"renderer"`` gives ``renderer.spp: ...``.
        """
        place = where or kind
        return validated(
            self.options_model(kind, name),
            raw,
            lambda path: ".".join([place, *(str(step) for step in path)]),
        )

    def create(self, kind: str, name: str, options: BaseModel | None = None) -> Any:
        """Import a component's class and call it with its options (the defaults, if None).

        Raises:
            InputError: no such name.
            ComponentError: its class cannot be imported; the message names the cause.
        """
        spec = self.spec(kind, name)
        factory = _import(spec.factory, f"{kind} {name!r}")
        return factory(self.options(kind, name, {}) if options is None else options)

    def load(self, kind: str, name: str) -> Any:
        """Import what a record's ``factory`` names, without calling it."""
        return _import(self.spec(kind, name).factory, f"{kind} {name!r}")


def _import(target: str, what: str) -> Any:
    module_name, _, attribute = target.partition(":")
    try:
        return getattr(importlib.import_module(module_name), attribute)
    except Exception as error:  # an import runs any code of a third party
        raise ComponentError(
            f"{what} cannot be loaded: {type(error).__name__}: {error} (see 'posse doctor')"
        ) from error
