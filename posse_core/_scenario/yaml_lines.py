"""YAML by the rules of YAML 1.2, with the line of every key.

Only safe loading is used. Numbers, booleans and null are those of YAML 1.2: ``1e-5`` is a number, ``no``
is a string, and a date stays a string.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml

from posse_core._errors import InputError

KeyPath = tuple[int | str, ...]


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


for _tag, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("int", r"[-+]?(0|[1-9][0-9]*)", "-+0123456789"),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
    ("merge", r"<<", "<"),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first)


class YamlText:
    """A parsed text: its value, and the line of each key.

    Raises:
        InputError: the text is not YAML, or a key is given twice.
    """

    def __init__(self, text: str, name: str) -> None:
        self.name = name
        self.lines: dict[KeyPath, int] = {}
        self.value: Any = None
        try:
            loader = _Loader(text)
            node = loader.get_single_node()
            if node is not None:
                self._walk(node, ())
                self.value = loader.construct_document(node)
        except yaml.MarkedYAMLError as error:
            line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
            raise InputError(f"{name}{line}: not valid YAML: {error.problem}") from None
        except (yaml.YAMLError, ValueError) as error:
            raise InputError(f"{name}: not valid YAML: {' '.join(str(error).split())}") from None

    @classmethod
    def read(cls, path: Path) -> YamlText:
        """Parse a file in UTF-8.

        Raises:
            InputError: the file cannot be read, or is not YAML.
        """
        try:
            return cls(path.read_text(encoding="utf-8"), str(path))
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise InputError(f"{path}: this is not text in UTF-8; a scenario is a YAML file") from None

    @classmethod
    def of(cls, value: Mapping[str, Any], name: str) -> YamlText:
        """The same for a mapping, which has no lines. It is copied."""
        text = cls("", name)
        text.value = deepcopy(dict(value))
        return text

    def where(self, path: KeyPath) -> str:
        """Where a key is, as in ``"file.yaml, line 7: orbit.tle"``; the line may be of the nearest key
        above."""
        for length in range(len(path), -1, -1):
            line = self.lines.get(path[:length])
            if line is not None:
                break
        source = f"{self.name}, line {line}" if line is not None and path else self.name
        dotted = ".".join(str(step) for step in path)
        return f"{source}: {dotted}" if dotted else source

    def _walk(self, node: yaml.Node, path: KeyPath) -> None:
        self.lines[path] = node.start_mark.line + 1
        if isinstance(node, yaml.MappingNode):
            seen = set()
            for key, value in node.value:
                if key.value in seen:
                    raise InputError(
                        f"{self.name}, line {key.start_mark.line + 1}: the key"
                        f" {key.value!r} is given twice; keep one"
                    )
                seen.add(key.value)
                self._walk(value, (*path, key.value))
                self.lines[(*path, key.value)] = key.start_mark.line + 1
        elif isinstance(node, yaml.SequenceNode):
            for i, value in enumerate(node.value):
                self._walk(value, (*path, i))
