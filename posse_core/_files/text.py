"""Text, CSV and JSON written piece by piece, so that memory does not grow with the frames."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

from posse_core._files.atomic import atomic_file


@contextlib.contextmanager
def text_file(path: Path) -> Iterator[TextIO]:
    """A UTF-8 text file that takes its name only when the block ends without an error."""
    with atomic_file(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        yield text
        text.flush()
        text.detach()


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table with its header, atomically."""
    with text_file(path) as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def write_items(text: TextIO, items: Iterable[Any]) -> None:
    """Write a JSON list, one item a line."""
    text.write("[")
    for i, item in enumerate(items):
        text.write(",\n" if i else "\n")
        text.write(json.dumps(item, ensure_ascii=False, allow_nan=False))
    text.write("\n]")


def write_members(text: TextIO, members: Iterable[tuple[str, Any]]) -> None:
    """Write a JSON object, one member a line."""
    text.write("{")
    for i, (key, value) in enumerate(members):
        text.write(",\n" if i else "\n")
        text.write(f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False, allow_nan=False)}")
    text.write("\n}")
