"""Files that are either complete or not there."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

PARTIAL = ".partial"
"""Ends the name of a file being written; one left over is of a process that was killed."""

_PART_BYTES = 1 << 20
"""Read at a time; hashlib's own file_digest fills a buffer for each file, which small ones wait for."""


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A binary file to write to, which takes its name only when the block ends without an error.

    So a reader finds the whole file, or the one that was there before, or none. What the block wrote is
    on the disk before the name changes::

        with atomic_file(folder / "ranges.json") as file:
            file.write(json.dumps(ranges).encode())

    Raises:
        OSError: the folder does not exist, or the disk is full.
    """
    descriptor, temporary = tempfile.mkstemp(PARTIAL, f".{path.name}.", path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            os.fchmod(stream.fileno(), 0o644)
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file, atomically."""
    with atomic_file(path) as stream:
        stream.write(data)


def write_json(path: Path, value: Any) -> None:
    """Write JSON, atomically; NaN is refused, since JSON has none."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    write_bytes(path, (text + "\n").encode())


def sha256(path: Path | str) -> str:
    """Hexadecimal SHA-256 of a file."""
    digest = hashlib.sha256()
    descriptor = os.open(path, os.O_RDONLY)  # Python's own files take half as long again to open
    try:
        while part := os.read(descriptor, _PART_BYTES):
            digest.update(part)
    finally:
        os.close(descriptor)
    return digest.hexdigest()
