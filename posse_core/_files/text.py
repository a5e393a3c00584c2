"""Writing text, CSV and JSON item by item, so that memory does not grow with the number of frames."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

from posse_core._files.atomic import atomic_file


@contextlib.contextmanager
def text_file(path: Path) -> Iterator[TextIO]:
    """Open a UTF-8 text file for writing; it gets its name only when the block ends without an error."""
    with atomic_file(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        yield text
        text.flush()
        text.detach()


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table with a header row atomically."""
    with text_file(path) as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def write_items(text: TextIO, items: Iterable[Any]) -> None:
    """Write a JSON list with one item per line."""
    text.write("[")
    for i, item in enumerate(items):
        text.write(",\n" if i else "\n")
        text.write(json.dumps(item, ensure_ascii=False, allow_nan=False))
    text.write("\n]")


def write_members(text: TextIO, members: Iterable[tuple[str, Any]]) -> None:
    """Write a JSON object with one member per line."""
    with json_object(text) as add:
        for key, value in members:
            add(key, value)


@contextlib.contextmanager
def json_object(text: TextIO) -> Iterator[Callable[[str, Any], None]]:
    """Write a JSON object with one member per line: the block calls what it gets with each key and its
    value."""
    before = "\n"

    def add(key: str, value: Any) -> None:
        nonlocal before
        text.write(
            f"{before}{json.dumps(key)}: {json.dumps(value, ensure_ascii=False, allow_nan=False)}"
        )
        before = ",\n"

    text.write("{")
    yield add
    text.write("\n}")
