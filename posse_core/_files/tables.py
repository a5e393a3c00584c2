"""Arrays over time, by name, in a file: ``.npz`` or ``.csv``.

Names say the shape: ``r_…``, ``v_…`` and ``omega_…`` are vectors (F, 3), ``q_…`` quaternions (F, 4) with
the scalar first, all others (F,). In a CSV file, with a row an instant, a vector's columns end in
``_x _y _z`` and a quaternion's in ``_w _x _y _z``. ``epoch_utc`` is the instant of t_s = 0; a CSV has
it in each row.
"""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file

_VECTOR = ("_x", "_y", "_z")
_SUFFIXES = {"q": ("_w", *_VECTOR), "r": _VECTOR, "v": _VECTOR, "omega": _VECTOR}


@dataclass(frozen=True)
class Table:
    """What a file held of the names that were asked for.

    Attributes:
        epoch_utc: ISO 8601, or None where the file has none.
        arrays: by name; all of F ≥ 1 rows, finite.
    """

    path: Path
    epoch_utc: str | None
    arrays: Mapping[str, FloatArray]

    def __getitem__(self, name: str) -> FloatArray:
        if name not in self.arrays:
            raise InputError(f"{self.path} has no {name!r}; files of 'posse propagate' have")
        return self.arrays[name]


def read_table(path: Path, names: Collection[str]) -> Table:
    """Read those of ``names`` that a file has, and leave the rest of it alone.

    Raises:
        InputError: the file is missing or of another kind, has none of the names, or an array has
            another shape, another length than the others, or a value that is no finite number.
    """
    try:
        match path.suffix:
            case ".npz":
                epoch_utc, raw = _read_npz(path, names)
            case ".csv":
                epoch_utc, raw = _read_csv(path, names)
            case _:
                raise _unknown_suffix(path)
    except FileNotFoundError:
        raise InputError(f"there is no file {path}; make one with 'posse propagate'") from None
    except (OSError, EOFError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}") from None
    if not raw:
        raise InputError(f"{path} has none of {', '.join(names)}")
    arrays: dict[str, FloatArray] = {}
    for name, array in raw.items():
        frames = len(next(iter(raw.values())))
        shape = (frames, len(_columns(name))) if len(_columns(name)) > 1 else (frames,)
        if array.shape != shape or array.dtype.kind not in "fiu":
            raise InputError(f"{path}: {name} has shape {array.shape}; {shape} of numbers is needed")
        arrays[name] = array.astype(np.float64)
        if frames == 0 or not np.all(np.isfinite(arrays[name])):
            raise InputError(f"{path}: {name} is empty or has a value that is no finite number")
    return Table(path, epoch_utc, arrays)


def write_table(path: Path, epoch_utc: str, arrays: Mapping[str, AnyArray]) -> None:
    """Write arrays of F rows, atomically; every number is read back to the bit.

    Raises:
        InputError: the file's name ends in neither ``.npz`` nor ``.csv``.
    """
    match path.suffix:
        case ".npz":
            members: dict[str, Any] = {"epoch_utc": np.array(epoch_utc), **arrays}
            with atomic_file(path) as stream:
                np.savez(stream, **members)
        case ".csv":
            text = io.StringIO()
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow(["epoch_utc", *(column for name in arrays for column in _columns(name))])
            flat = [part for x in arrays.values() for part in x.reshape(len(x), -1).T]
            for row in zip(*(part.tolist() for part in flat), strict=True):
                rows.writerow([epoch_utc, *row])
            with atomic_file(path) as stream:
                stream.write(text.getvalue().encode())
        case _:
            raise _unknown_suffix(path)


def _columns(name: str) -> list[str]:
    """Names of the columns that an array takes in a CSV file."""
    return [name + suffix for suffix in _SUFFIXES.get(name.split("_")[0], ("",))]


def _read_npz(path: Path, names: Collection[str]) -> tuple[str | None, dict[str, AnyArray]]:
    with np.load(path, allow_pickle=False) as archive:
        epoch_utc = str(archive["epoch_utc"]) if "epoch_utc" in archive else None
        return epoch_utc, {name: np.atleast_1d(archive[name]) for name in names if name in archive}


def _read_csv(path: Path, names: Collection[str]) -> tuple[str | None, dict[str, AnyArray]]:
    with open(path, newline="", encoding="utf-8") as stream:
        header, *rows = [row for row in csv.reader(stream, skipinitialspace=True) if row] or [[]]
    places = {column: place for place, column in enumerate(header)}
    out: dict[str, AnyArray] = {}
    for name in names:
        if not all(column in places for column in _columns(name)):
            continue
        parts = [_numbers(rows, column, places[column], path) for column in _columns(name)]
        out[name] = np.stack(parts, axis=-1) if len(parts) > 1 else parts[0]
    epoch_utc = rows[0][places["epoch_utc"]] if rows and "epoch_utc" in places else None
    return epoch_utc, out


def _numbers(rows: list[list[str]], column: str, place: int, path: Path) -> FloatArray:
    try:
        return np.array([row[place] for row in rows], dtype=np.float64)
    except IndexError:
        raise InputError(f"{path}: a row is too short for the column {column!r}") from None
    except ValueError as error:
        raise InputError(f"{path}: column {column!r}: {error}") from None


def _unknown_suffix(path: Path) -> InputError:
    return InputError(f"{path}: the name of a trajectory ends in .npz or .csv")
