"""Writing files atomically: a file is either complete or not there."""

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
"""Suffix of a file that is being written. One that is left over is from a process that was killed."""

_CHUNK_BYTES = 1 << 20
"""Bytes read at a time. ``hashlib.file_digest`` is slower for small files: it fills a large buffer."""


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a binary file for writing; it gets its name only when the block ends without an error.

    A reader therefore finds the complete new file, the file that was there before, or none. The content
    is flushed to disk before the file is renamed::

        with atomic_file(folder / "ranges.json") as file:
            file.write(json.dumps(ranges).encode())

    Raises:
        OSError: The folder does not exist, or the disk is full.
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
    """Write a complete file atomically."""
    with atomic_file(path) as stream:
        stream.write(data)


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically. NaN raises ValueError, since JSON cannot represent it."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    write_bytes(path, (text + "\n").encode())


def sha256(path: Path | str) -> str:
    """Return the hexadecimal SHA-256 digest of a file."""
    digest = hashlib.sha256()
    descriptor = os.open(path, os.O_RDONLY)  # faster than open() for many small files
    try:
        while chunk := os.read(descriptor, _CHUNK_BYTES):
            digest.update(chunk)
    finally:
        os.close(descriptor)
    return digest.hexdigest()
