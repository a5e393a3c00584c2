"""The registry of components by kind and name: the records of plugins, and making a component from one.

A record names its class by a string, ``"module:Class"``, which is imported when the component is
first made. Listing what is installed therefore imports no renderer and no deep-learning library.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import BaseModel

from posse_core._errors import ComponentError, InputError, PosseError
from posse_core._plugins.kinds import KINDS, RESERVED, import_target, reserved_for, shown
from posse_core._plugins.options import closest, validated

API_VERSION: Final = 2
"""Version of the interfaces of :mod:`posse_core`; records for another version are refused.

Version 2 came with ``Component[Options]``, ``PropagationProblem``, ``LabelLine``, and a
``RenderRequest`` that holds the craft's state alone.
"""

CORE: Final = "core"
"""Name of the plugin that holds the core's own components."""

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]*")
_TARGET = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


@dataclass(frozen=True)
class ComponentSpec:
    """The record by which a plugin describes one component.

    Attributes:
        name: the name that users write (``--renderer mitsuba``): lower case, digits, ``.``, ``_``,
        ``-``. summary: one line for ``posse plugins`` and ``posse describe``. factory:
        ``"module:Class"``; the class is called with one argument, its options. For a
            subcommand it is a :class:`click.Command`.
        options: ``"module:Model"``, a subclass of :class:`posse_core.Options`. Importing its module must
            be fast.
        capabilities: capabilities of the component, out of those that ``posse describe KIND`` lists.
        api: the :data:`API_VERSION` that the component was written for.
    """

    name: str
    summary: str
    factory: str
    options: str = "posse_core._plugins.options:NoOptions"
    capabilities: frozenset[str] = frozenset()
    api: int = API_VERSION

    def problem(self) -> str | None:
        """Return what is wrong with this record, or None."""
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            return f"the name {self.name!r} is not lower-case letters, digits, '.', '_', '-'"
        for key in ("factory", "options"):
            if not _TARGET.fullmatch(str(getattr(self, key))):
                return f"{key} of {self.name!r} is not of the form 'module:Name'"
        words = self.capabilities
        if not isinstance(words, Set) or not all(isinstance(word, str) for word in words):
            return f"the capabilities of {self.name!r} are not a set of words"
        return None


@dataclass
class Registry:
    """The records of all components by kind and name, with the plugin of each."""

    _specs: dict[str, dict[str, tuple[ComponentSpec, str]]] = field(
        default_factory=lambda: {kind: {} for kind in KINDS}
    )
    broken: dict[str, str] = field(default_factory=dict)
    """Name of each plugin that could not be loaded → the cause, which messages quote."""

    def add(self, kind: str, spec: ComponentSpec, plugin: str) -> None:
        """Add a record, whose name must be free."""
        self._specs[kind][spec.name] = (spec, plugin)

    def owner(self, kind: str, name: str) -> str | None:
        """Return the plugin of a component, or None if there is no such component."""
        entry = self._specs[kind].get(name)
        return entry[1] if entry else None

    def is_core(self, kind: str, name: str) -> bool:
        """Whether a component is one of the core's own."""
        return self.owner(kind, name) == CORE

    def specs(self, kind: str) -> Iterator[ComponentSpec]:
        """All records of a kind, by name."""
        for name in sorted(self._specs[kind]):
            yield self._specs[kind][name][0]

    def names(self, kind: str) -> list[str]:
        """Return the sorted names of a kind."""
        return sorted(self._specs[kind])

    def spec(self, kind: str, name: str) -> ComponentSpec:
        """Return the record of a component.

        Raises:
            InputError: There is no such name. The message has the most similar name, the installed ones,
                and the error of a broken plugin that may have been meant.
        """
        entry = self._specs[kind].get(name)
        if entry is not None:
            return entry[0]
        names = self.names(kind)
        message = f"no {kind} named {name!r}{self._way_out(kind, name) or '.'}"
        message += f" Installed: {', '.join(names)}." if names else " None is installed."
        for plugin, cause in self.broken.items():
            official = RESERVED.get(reserved_for(kind, name) or "", {}).get("plugin", ())
            if plugin in official or re.search(rf"(^|[_.-]){re.escape(name)}($|[_.-])", plugin):
                message += f" The plugin {plugin!r} was not loaded: {cause}."
        raise InputError(message)

    def _way_out(self, kind: str, name: str) -> str:
        """The nearest name that is installed or official, and what to install for it."""
        absent = {
            known: distribution
            for distribution, reserved in RESERVED.items()
            if not self.broken.keys() & set(reserved["plugin"])
            for known in reserved.get(kind, ())
            if known not in self._specs[kind]
        }
        if name in absent:
            return f": it comes with {absent[name]}, so pip install {absent[name]}."
        close = closest(name, [*self.names(kind), *absent])
        if close is None:
            return ""
        install = f" (pip install {absent[close]})" if close in absent else ""
        return f"; did you mean {close!r}?{install}"

    def options_model(self, kind: str, name: str) -> type[BaseModel]:
        """Return the pydantic model of a component's options."""
        spec = self.spec(kind, name)
        model = self._import(spec.options, kind, name)
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            raise self._unusable(kind, name, spec.options, "is not a pydantic model")
        return model

    def options(
        self, kind: str, name: str, raw: Mapping[str, Any], where: str | None = None
    ) -> BaseModel:
        """Validate options that the user gave.

        Args:
            kind, name: of the component.
            raw: key → value, without ``name``.
            where: prefix of keys in messages; ``"renderer"`` gives ``renderer.spp: ...``.
        """
        prefix = where or kind
        return validated(
            self.options_model(kind, name),
            raw,
            lambda path: ".".join([prefix, *(str(step) for step in path)]),
        )

    def create(self, kind: str, name: str, options: BaseModel | None = None) -> Any:
        """Import a component's class and make the component with options (the defaults if None).

        Raises:
            InputError: There is no such name.
            ComponentError: The class cannot be imported, is not of this kind, or cannot be made; the
                message names plugin, component and cause.
        """
        factory = self.load(kind, name)
        given = self.options(kind, name, {}) if options is None else options
        try:
            return factory(given)
        except PosseError:
            raise
        except (Exception, SystemExit) as error:  # third-party code can raise anything
            raise ComponentError(
                f"{self._called(kind, name)} cannot be made: {type(error).__name__}: {error}"
            ) from error

    def load(self, kind: str, name: str) -> Any:
        """Import the object that a record's ``factory`` names, without calling it.

        Raises:
            InputError: There is no such name.
            ComponentError: See :meth:`create`.
        """
        spec = self.spec(kind, name)
        found = self._import(spec.factory, kind, name)
        fault = KINDS[kind].class_fault(found, spec.capabilities)
        if fault is not None:
            raise self._unusable(kind, name, spec.factory, fault)
        return found

    def _import(self, target: str, kind: str, name: str) -> Any:
        try:
            return import_target(target)
        except (Exception, SystemExit) as error:  # imported third-party code can raise anything
            raise ComponentError(
                f"{self._called(kind, name)} cannot be loaded: {type(error).__name__}: {error}"
                " (see 'posse doctor')"
            ) from error

    def _unusable(self, kind: str, name: str, target: str, fault: str) -> ComponentError:
        return ComponentError(f"{self._called(kind, name)} cannot be used: {shown(target)} {fault}")

    def _called(self, kind: str, name: str) -> str:
        return f"{kind} {name!r} of plugin {self.owner(kind, name)!r}"
