"""A recipe's file: written with a word on each key, and read back with the line of each fault."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._plugins.options import validated
from posse_core._recipe.model import Recipe
from posse_core._scenario.yaml_lines import YamlText

RECIPE: Final = "recipe.yaml"
_HEAD: Final = """\
# How the nets in this folder are made: posse recipe {file}
# goes on with it, or does nothing where all is done. 'posse describe recipe' explains the keys. To
# change something that is done already, choose another folder, or remove what the message names.
"""


def write_recipe(recipe: Recipe, path: Path) -> None:
    """Write a recipe with all its keys."""
    keys = recipe.model_dump(mode="json")
    text = yaml.safe_dump(keys, sort_keys=False, allow_unicode=True, default_flow_style=None, width=100)
    write_bytes(path, (_HEAD.format(file=path) + text).encode())


def read_recipe(path: Path) -> Recipe:
    """Read a recipe.

    Raises:
        InputError: the file cannot be read, or a key is wrong; the message names its line.
    """
    text = YamlText.read(path)
    if not isinstance(text.value, dict):
        raise InputError(f"{path}: a recipe is a mapping of keys; see 'posse describe recipe'")
    return validated(Recipe, text.value, text.where)


def recipe_of(keys: Mapping[str, Any], name: str) -> Recipe:
    """Check the keys of a recipe that is not in a file; ``name`` stands in messages.

    Raises:
        InputError: a key is wrong.
    """
    return validated(Recipe, keys, YamlText.of(keys, name).where)
