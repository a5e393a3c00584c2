"""Writing files atomically: a file is either complete or not there."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from glob import escape
from pathlib import Path
from typing import Any, BinaryIO

from posse_core._errors import InputError

PARTIAL = ".partial"
"""Suffix of a file or folder that is being written. One left over is from a process that was killed."""

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


@contextlib.contextmanager
def atomic_folder(folder: Path) -> Iterator[Path]:
    """Give an empty folder, whose files move into ``folder`` when the block ends without an error.

    Otherwise nothing is left, and what a process that was killed left of the same folder is removed.
    ``folder`` is made if need be; other files in it stay, and files of the same names are replaced, each
    atomically.

    Raises:
        OSError: The folder cannot be made, or the disk is full.
    """
    above = next(path for path in (folder, *folder.absolute().parents) if path.is_dir())
    for place in {above, folder.absolute().parent}:  # the second, where the folder was not there yet
        for left in place.glob(f".{escape(folder.name)}.*{PARTIAL}"):
            _remove_if_left(left)
    with _new_folder(above, f".{folder.name}.") as building:
        yield building
        folder.mkdir(parents=True, exist_ok=True)
        for path in sorted(building.rglob("*")):
            target = folder / path.relative_to(building)
            if path.is_dir():
                target.mkdir(exist_ok=True)
            else:
                os.replace(path, target)


@contextlib.contextmanager
def folder_of_result(folder: Path) -> Iterator[None]:
    """Make a folder for what the block writes, which goes away again if the block refuses its input.

    After any other end what the block wrote stays, for work to be continued. A folder that was there
    before is left as the block leaves it.

    Raises:
        InputError: The folder cannot be made.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be a folder: {error.strerror}") from None
    try:
        yield
    except InputError:
        if made:
            shutil.rmtree(made[-1])
        raise


@contextlib.contextmanager
def _new_folder(above: Path, prefix: str) -> Iterator[Path]:
    """A new folder, locked as long as this process works in it, and removed at the end."""
    while True:
        building = Path(tempfile.mkdtemp(PARTIAL, prefix, above))
        with _opened(building) as descriptor:
            if descriptor is None or not _is_ours(building, descriptor):
                continue  # before it was locked, another process took it for one that was left
            try:
                yield building
            finally:
                shutil.rmtree(building, ignore_errors=True)
            return


def _is_ours(building: Path, descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks, where none is taken for left either
        return True
    return building.is_dir()


def _remove_if_left(folder: Path) -> None:
    """Remove a folder unless a process that lives has locked it."""
    with _opened(folder) as descriptor:
        if descriptor is not None:
            with contextlib.suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int | None]:
    """A descriptor of a folder, or None where it is not there; closing it unlocks the folder."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        yield None
        return
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def remove_partial(folder: Path) -> None:
    """Remove what a process that was killed left unfinished directly in a folder."""
    for name in os.listdir(folder):
        path = folder / name
        if not name.endswith(PARTIAL):
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a complete file atomically."""
    with atomic_file(path) as stream:
        stream.write(data)


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically. NaN raises ValueError, since JSON cannot represent it."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    write_bytes(path, (text + "\n").encode())


def sha256(path: Path | str) -> str:
    """Return the hexadecimal SHA-256 digest of a file.

    Raises:
        OSError: There is no such file, or it is a folder, a pipe or a device.
    """
    digest = hashlib.sha256()
    # This is faster than open() for many small files. A pipe would be waited for without O_NONBLOCK.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise IsADirectoryError(errno.EISDIR, "Is not a file", str(path))
        while chunk := os.read(descriptor, _CHUNK_BYTES):
            digest.update(chunk)
    finally:
        os.close(descriptor)
    return digest.hexdigest()
