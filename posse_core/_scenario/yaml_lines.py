"""YAML by the rules of YAML 1.2, with the line of every key.

Only safe loading is used. Numbers, booleans and null are those of YAML 1.2: ``1e-5`` is a number, ``no``
is a string, and a date stays a string. Before a value is made, the tree of its nodes is checked: aliases
that would grow without bounds, anchors that contain themselves, and tags that do not fit are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, Final

import yaml

from posse_core._errors import InputError
from posse_core._files.reading import read_text

KeyPath = tuple[int | str, ...]
_MOST_VALUES: Final = 1_000_000
"""The most values of a text, where an alias counts as often as it is used."""
_DEEPEST: Final = 50
"""The most levels that keys and lists may be nested."""
_MAPPING, _SEQUENCE = "tag:yaml.org,2002:map", "tag:yaml.org,2002:seq"
_STRING: Final = "tag:yaml.org,2002:str"


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
        self._values = 0
        try:
            self._loader = _Loader(text)
            node = self._loader.get_single_node()
            if node is not None:
                self._walk(node, ())
                self.value = self._loader.construct_document(node)
        except yaml.MarkedYAMLError as error:
            line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
            raise InputError(f"{name}{line}: not valid YAML: {error.problem}") from None
        except (yaml.YAMLError, ValueError) as error:
            raise InputError(f"{name}: not valid YAML: {' '.join(str(error).split())}") from None
        except RecursionError:
            raise InputError(f"{name}: nested deeper than {_DEEPEST} levels") from None

    @classmethod
    def read(cls, path: Path) -> YamlText:
        """Parse a file in UTF-8.

        Raises:
            InputError: the file cannot be read, or is not YAML.
        """
        return cls(read_text(path), str(path))

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
        """Note the line of each key, and check the node before a value is made of it."""
        self.lines[path] = node.start_mark.line + 1
        self._values += 1
        if self._values > _MOST_VALUES:
            raise self._refused(node, f"more than {_MOST_VALUES} values, aliases included; shorten it")
        if len(path) > _DEEPEST:
            raise self._refused(
                node, f"nested deeper than {_DEEPEST} levels, or an anchor that contains itself"
            )
        if node.tag != self._natural_tag(node):
            raise self._refused(node, f"the tag {node.tag!r} does not fit; leave it out")
        if isinstance(node, yaml.MappingNode):
            seen = set()
            for key, value in node.value:
                if not isinstance(key, yaml.ScalarNode):
                    raise self._refused(key, "a key must be a word, not a list or a mapping")
                if key.value in seen:
                    raise self._refused(key, f"the key {key.value!r} is given twice; keep one")
                seen.add(key.value)
                self._walk(key, (*path, key.value))
                self._walk(value, (*path, key.value))
                self.lines[(*path, key.value)] = key.start_mark.line + 1
        elif isinstance(node, yaml.SequenceNode):
            for i, value in enumerate(node.value):
                self._walk(value, (*path, i))
        elif "\0" in node.value:
            raise self._refused(node, "a text has the character NUL; leave it out")

    def _natural_tag(self, node: yaml.Node) -> str:
        """The tag that a node has if the text gives none; that of any scalar may be a string."""
        if not isinstance(node, yaml.ScalarNode):
            return _MAPPING if isinstance(node, yaml.MappingNode) else _SEQUENCE
        if node.tag == _STRING:
            return _STRING
        tag = self._loader.resolve(yaml.ScalarNode, node.value, (True, False))  # type: ignore[no-untyped-call]
        return str(tag)

    def _refused(self, node: yaml.Node, why: str) -> InputError:
        return InputError(f"{self.name}, line {node.start_mark.line + 1}: {why}")
