"""A component chosen in a scenario: its name, and options that the component's own model checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_serializer, model_validator

from posse_core._plugins.options import Options
from posse_core._plugins.registry import Registry


class ComponentChoice(Options):
    """A component, written as its name or as a mapping of ``name`` and the component's options."""

    name: str = Field(description="name of the component; 'posse plugins' lists them")
    options: Mapping[str, Any] = Field(
        default_factory=dict, description="the component's options; see 'posse describe KIND NAME'"
    )

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, raw: Any) -> Any:
        return gathered_options(raw, cls.key())

    @model_serializer
    def _flatten(self) -> dict[str, Any]:
        return {self.key(): self.name, **self.options}

    @classmethod
    def key(cls) -> str:
        """The key in a scenario that holds the name."""
        return cls.model_fields["name"].alias or "name"


class TargetChoice(ComponentChoice):
    """The spacecraft: a built-in one by ``name``, a ``mesh`` file, or a ``package`` folder."""

    @model_validator(mode="before")
    @classmethod
    def _name_by_file(cls, raw: Any) -> Any:
        if isinstance(raw, Mapping) and "name" not in raw:
            kinds = [kind for kind in ("mesh", "package") if kind in raw]
            if len(kinds) != 1:
                raise ValueError("give exactly one of name, mesh, package")
            return gathered_options({"name": kinds[0], **raw}, "name")
        return raw


def create(registry: Registry, kind: str, choice: ComponentChoice) -> Any:
    """Make the component that a scenario chooses."""
    options = registry.options(kind, choice.name, choice.options)
    return registry.create(kind, choice.name, options)


def gathered_options(raw: Any, key: str) -> Any:
    """Move the keys beside the one that holds the name into ``options``."""
    if isinstance(raw, str):
        return {key: raw}
    if isinstance(raw, Mapping) and "options" not in raw:
        given = dict(raw)
        name = {key: given.pop(key)} if key in given else {}
        return {**name, "options": given}
    return raw
