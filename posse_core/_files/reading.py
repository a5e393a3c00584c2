"""Reading files that may hold anything: what a user names is opened and parsed here.

Whatever is wrong with such a file ends in an :class:`InputError` of one line that names it.
"""

from __future__ import annotations

import json
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from posse_core._arrays import AnyArray
from posse_core._errors import InputError
from posse_core._plugins.options import validated

MOST_BYTES: Final = 1 << 30
"""Largest file that is read as a whole, and largest content of an archive: both are kept in memory."""

MISSING: Final = "cannot be read: there is no such file"


class FileRecord(BaseModel):
    """Base of the records that files of JSON hold: frozen, without conversion of types, all finite.

    Keys that a record does not know are ignored, as other programs write more.
    """

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False, extra="ignore")


RecordT = TypeVar("RecordT", bound=BaseModel)


def check_file(path: Path, missing: str = MISSING) -> None:
    """Check that a path is a file that can be read as a whole, before anything opens it.

    Args:
        path: of the file.
        missing: what the message says of a file that is not there, with the way out.

    Raises:
        InputError: There is none, it is a folder, a pipe or a device, or it is too large.
    """
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path}: {missing}") from None
    except (OSError, ValueError) as error:  # a path too long, a loop of links; the character NUL
        raise _unreadable(path, error) from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe or a device"
        raise InputError(f"{path}: is {kind}, not a file; name a file")
    if status.st_size > MOST_BYTES:
        raise InputError(
            f"{path}: has {status.st_size / 2**30:.1f} GiB, more than the {MOST_BYTES >> 30} GiB that"
            " are read; divide it"
        )


def read_bytes(path: Path, missing: str = MISSING) -> bytes:
    """Read a file as a whole; see :func:`check_file`.

    Raises:
        InputError: The file cannot be read.
    """
    check_file(path, missing)
    try:
        return path.read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None


def read_text(path: Path, missing: str = MISSING) -> str:
    """Read a file of text in UTF-8; see :func:`check_file`.

    Raises:
        InputError: The file cannot be read, or is not text.
    """
    try:
        return read_bytes(path, missing).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8") from None


def parsed_json(text: str | bytes, name: str) -> Any:
    """Parse JSON.

    Args:
        text: the JSON.
        name: of its origin, for messages.

    Raises:
        InputError: The text is not JSON, or is nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise InputError(f"{name}: not JSON that can be read: it is nested too deeply") from None
    except ValueError as error:
        raise InputError(f"{name}: not JSON: {error}") from None


def read_record(path: Path, model: type[RecordT], kind: str, missing: str = MISSING) -> RecordT:
    """Read a file of JSON as a record.

    Args:
        path: of the file.
        model: of the record.
        kind: what the file is, in words for messages, such as "a camera file".
        missing: see :func:`check_file`.

    Raises:
        InputError: The file cannot be read, or is not such a record; the message names the first key.
    """
    return record_of(read_bytes(path, missing), model, f"{path}: not {kind}")


def record_of(text: bytes, model: type[RecordT], prefix: str) -> RecordT:
    """Read JSON as a record.

    Args:
        text: the JSON.
        model: of the record.
        prefix: of messages, before the key.

    Raises:
        InputError: The text is not such a record; the message names the first key.
    """
    return validated(model, text, lambda key: ": ".join([prefix, *_dotted(key)]))


def read_npz(path: Path, wanted: Callable[[str], bool], missing: str = MISSING) -> dict[str, AnyArray]:
    """Read the arrays of an ``.npz`` file whose names are wanted.

    Raises:
        InputError: The file is missing, damaged, or has an array of objects.
    """
    check_file(path, missing)
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_BYTES:
            raise ValueError(f"its arrays have {size / 2**30:.1f} GiB, which is too much")
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files if wanted(name)}
    except Exception as error:  # zipfile, zlib and numpy raise various errors for a damaged file
        raise _unreadable(path, error, " as NPZ") from None


def _dotted(key: tuple[int | str, ...]) -> list[str]:
    return [".".join(map(str, key))] if key else []


def _unreadable(path: Path, error: Exception, kind: str = "") -> InputError:
    reason = error.args[0] if error.args and isinstance(error.args[0], str) else "it is damaged"
    if isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    return InputError(f"{path}: cannot be read{kind}: {' '.join(reason.split())}")
