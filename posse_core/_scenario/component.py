"""A component chosen in a scenario: its name, and options that the component's own model checks."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, model_serializer, model_validator

from posse_core._errors import InputError
from posse_core._plugins.options import Options
from posse_core._plugins.registry import Registry
from posse_core._scenario.materials import MaterialKeys


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

    materials: Mapping[str, MaterialKeys] = Field(
        default_factory=dict,
        description='name of a material, or a pattern such as "foil_*" for those without a key of their'
        " own → what replaces its values",
    )

    @model_validator(mode="before")
    @classmethod
    def _name_by_file(cls, raw: Any) -> Any:
        if isinstance(raw, Mapping) and "name" not in raw:
            kinds = [kind for kind in ("mesh", "package") if kind in raw]
            if len(kinds) != 1:
                raise ValueError("give exactly one of name, mesh, package")
            raw = {"name": kinds[0], **raw}
        return gathered_options(raw, "name", "materials")

    @model_serializer
    def _flatten(self) -> dict[str, Any]:
        changed = {name: keys.model_dump(exclude_none=True) for name, keys in self.materials.items()}
        return {"name": self.name, **self.options, **({"materials": changed} if changed else {})}


def target_named(text: str, registry: Registry) -> TargetChoice:
    """The spacecraft that one word means: its name or, if none has it, the folder of a package.

    Raises:
        InputError: there is neither.
    """
    names = registry.names("scene")
    is_folder = os.path.isdir(text)  # unlike Path.is_dir, False where the text is too long for a path
    if text in names or not (is_folder or len(Path(text).parts) > 1):
        registry.options("scene", text, {}, where=text)
        return TargetChoice(name=text)
    if not is_folder:
        raise InputError(f"{text}: no such package folder; make one with 'posse import MODEL'")
    return TargetChoice.model_validate({"package": text})


def create(registry: Registry, kind: str, choice: ComponentChoice) -> Any:
    """Make the component that a scenario chooses."""
    options = registry.options(kind, choice.name, choice.options)
    return registry.create(kind, choice.name, options)


def gathered_options(raw: Any, key: str, *others: str) -> Any:
    """Move the keys beside the one that holds the name, and the others, into ``options``."""
    if isinstance(raw, str):
        return {key: raw}
    if isinstance(raw, Mapping) and "options" not in raw:
        given = dict(raw)
        kept = {name: given.pop(name) for name in (key, *others) if name in given}
        return {**kept, "options": given}
    return raw
