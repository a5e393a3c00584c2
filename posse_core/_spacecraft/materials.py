"""Materials chosen by name, and replaced by what a user gives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, TypeVar

from posse_core._arrays import AnyArray
from posse_core._errors import InputError
from posse_core._model.spacecraft import Material, Spacecraft
from posse_core._plugins.options import nearest
from posse_core._scenario.materials import MaterialKeys

T = TypeVar("T")


def chosen_materials(
    names: Iterable[str], choices: Mapping[str, T], spacecraft: str, where: str
) -> dict[str, T]:
    """Return what is chosen for each material: by its own name, else by the first pattern that fits.

    Args:
        names: of the spacecraft's materials.
        choices: name of a material, or pattern → what is chosen for it.
        spacecraft: its name, for messages.
        where: the key that holds the choices, likewise.

    Raises:
        InputError: a choice is for a material that there is not.
    """
    names = list(names)
    for key in choices:
        if not any(fnmatchcase(name, key) for name in names):
            raise InputError(
                f"{where}.{key}: {spacecraft} has no such material{nearest(key, names)} (its materials:"
                f" {', '.join(names)})"
            )
    chosen = {}
    for name in names:
        fitting = [key for key in (name, *choices) if key in choices and fnmatchcase(name, key)]
        if fitting:
            chosen[name] = choices[fitting[0]]
    return chosen


def with_materials(
    spacecraft: Spacecraft, choices: Mapping[str, MaterialKeys], where: str
) -> Spacecraft:
    """Return the spacecraft with materials replaced; see :func:`chosen_materials`."""
    chosen = chosen_materials(spacecraft.materials, choices, spacecraft.name, where)
    if not chosen:
        return spacecraft
    materials = {
        name: _replaced(material, chosen[name]) if name in chosen else material
        for name, material in spacecraft.materials.items()
    }
    return replace(spacecraft, materials=materials)


def _replaced(material: Material, keys: MaterialKeys) -> Material:
    given: dict[str, Any] = {name: value for name, value in keys if value is not None}
    if "base_color" in given:
        given["base_color_texture"] = None
    texture = material.metallic_roughness_texture
    if texture is not None:
        given["metallic_roughness_texture"] = _without(
            texture, metallic="metallic" in given, roughness="roughness" in given
        )
    return replace(material, **given)


def _without(texture: AnyArray, *, metallic: bool, roughness: bool) -> AnyArray | None:
    """The texture (H, W, 2) of metallic and roughness without what is given; None if nothing is left."""
    if metallic and roughness:
        return None
    left = texture.copy()
    if metallic:
        left[..., 0] = 255
    if roughness:
        left[..., 1] = 255
    return left
