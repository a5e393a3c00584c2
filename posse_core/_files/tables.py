"""Tables: named arrays over time in an ``.npz`` or ``.csv`` file.

An array's name determines its shape: ``r_…``, ``v_…`` and ``omega_…`` are vectors (F, 3), ``q_…`` are
quaternions (F, 4) with the scalar first, and all others are (F,). A CSV file has one row per instant;
the columns of a vector end in ``_x _y _z`` and those of a quaternion in ``_w _x _y _z``. ``epoch_utc``
is the instant of t_s = 0; a CSV file repeats it in every row.

Extras are arrays (F, ...) of any shape. A file holds them under ``extra_`` and their name; in a CSV file
each number of a row has its own column, such as ``extra_torque_n_m[0]``.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file
from posse_core._files.reading import read_npz, read_text

_VECTOR = ("_x", "_y", "_z")
_SUFFIXES = {"q": ("_w", *_VECTOR), "r": _VECTOR, "v": _VECTOR, "omega": _VECTOR}
_EXTRA = "extra_"
_QUATERNION_LENGTH_ERROR = 1e-3
"""Largest allowed difference of a quaternion's length from 1."""
GUIDE: Final = "docs/dynamics.md"
"""The page on tables of a trajectory."""
_MISSING = "there is no such file; make one with 'posse propagate'"
_EXTRA_COLUMN = re.compile(rf"{_EXTRA}(\w+?)((?:\[\d+\])*)")


@dataclass(frozen=True)
class Table:
    """The requested arrays of a file.

    Attributes:
        path: the file.
        epoch_utc: ISO 8601, or None where the file has no epoch.
        known: names in the file: of arrays, or of a CSV file's columns.
        arrays: arrays by name; all are finite and have the same number of rows F ≥ 1.
        extras: extras by name, (F, ...) and finite; empty where they were not requested.
        guide: page that has an example of such a file, for messages.
    """

    path: Path
    epoch_utc: str | None
    known: tuple[str, ...]
    arrays: Mapping[str, FloatArray]
    extras: Mapping[str, FloatArray] = field(default_factory=dict)
    guide: str = GUIDE

    def __getitem__(self, name: str) -> FloatArray:
        self.require(name)
        return self.arrays[name]

    @property
    def epoch(self) -> Epoch | None:
        """The instant of ``epoch_utc``.

        Raises:
            InputError: it is none; the message names the file.
        """
        if self.epoch_utc is None:
            return None
        try:
            return Epoch.from_iso(self.epoch_utc)
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None

    def require(self, *names: str) -> None:
        """Check that the file has arrays.

        Raises:
            InputError: it lacks some; the message lists them, and what in the file may be meant.
        """
        missing = [name for name in names if name not in self.arrays]
        if missing:
            columns = [
                column
                for name in missing
                for column in (_columns(name) if self.path.suffix == ".csv" else [name])
                if column not in self.known
            ]
            rest = _lack(self.path, missing, self.known, list(self.arrays), self.guide)
            raise InputError(f"{self.path} has no {', '.join(columns)}{rest}")


def read_table(path: Path, names: Collection[str], *, extras: bool = False, guide: str = GUIDE) -> Table:
    """Read those of the named arrays that a file has, and ignore the others in the file.

    Args:
        path: an ``.npz`` or ``.csv`` file.
        names: the arrays to read.
        extras: whether to read all extras too.
        guide: page that has an example of such a file, for messages.

    Raises:
        InputError: The file is missing or of another kind, has none of the names, or has an array of
            another shape, of another length than the others, or with a value that is not finite.
    """
    try:
        match path.suffix:
            case ".npz":
                known, epoch_utc, raw, found = _read_npz(path, names, extras)
            case ".csv":
                known, epoch_utc, raw, found = _read_csv(path, names, extras)
            case _:
                raise _unknown_suffix(path)
    except (csv.Error, TypeError, ValueError) as error:
        raise InputError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}") from None
    if not raw:
        rest = _lack(path, list(names), known, [], guide)
        raise InputError(f"{path} has none of {', '.join(names)}{rest}")
    frames = len(next(iter(raw.values())))
    return Table(
        path,
        epoch_utc,
        known,
        {name: _checked(array, _shape(name, frames), name, path) for name, array in raw.items()},
        {
            name: _checked(array, (frames, *array.shape[1:]), f"{_EXTRA}{name}", path)
            for name, array in found.items()
        },
        guide,
    )


def _lack(
    path: Path, missing: Sequence[str], known: Sequence[str], read: Sequence[str], guide: str
) -> str:
    """The message about arrays that a file lacks, but for its beginning.

    Args:
        path: the file.
        missing: the arrays.
        known: names in the file.
        read: arrays that it has, whose names mean nothing else.
        guide: page that has an example of such a file.
    """
    is_csv = path.suffix == ".csv"
    wanted = [column for name in missing for column in (_columns(name) if is_csv else [name])]
    shown = [" ".join(name.split())[:40] for name in known[:100]]
    taken = {*wanted, *read, *(column for name in read for column in _columns(name))}
    free = [name for name in shown if name not in taken]
    absent = [name for name in wanted if name not in known]
    guesses = {name: get_close_matches(name, free, n=1, cutoff=0.4) for name in absent}
    meant = [f"{close[0]!r} for {name!r}" for name, close in guesses.items() if close]
    hint = f"; did you mean {', '.join(meant)}?" if meant else ""
    there = (
        f"it has the {'columns' if is_csv else 'arrays'} {', '.join(shown)}" if shown else "it is empty"
    )
    return f"{hint} ({there}; {guide} has an example)"


def _shape(name: str, frames: int) -> tuple[int, ...]:
    columns = len(_columns(name))
    return (frames, columns) if columns > 1 else (frames,)


def _checked(array: AnyArray, shape: tuple[int, ...], name: str, path: Path) -> FloatArray:
    if array.shape != shape or array.dtype.kind not in "fiu":
        raise InputError(f"{path}: {name} has shape {array.shape}, but must be numbers of shape {shape}")
    numbers = array.astype(np.float64)
    if numbers.size == 0 or not np.all(np.isfinite(numbers)):
        raise InputError(f"{path}: {name} is empty or has a value that is not a finite number")
    if name.startswith("q_"):
        off = np.abs(np.linalg.norm(numbers, axis=-1) - 1) > _QUATERNION_LENGTH_ERROR
        if off.any():
            raise InputError(
                f"{path}: {name}, row {off.argmax() + 1}: a quaternion is not of length one"
            )
    return numbers


def check_orbit(path: Path, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> None:
    """Check that each state (F, 3), (F, 3) of a file defines the plane of an orbit, and so RTN axes.

    Raises:
        InputError: Position and velocity are parallel or zero, or beyond what can be computed with.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        momentum = np.linalg.norm(np.cross(r_eci_m, v_eci_m_s), axis=-1)
    bad = ~((momentum > 0) & np.isfinite(momentum))
    if bad.any():
        raise InputError(
            f"{path}: the target's position and velocity are zero or parallel in state"
            f" {bad.argmax() + 1}, so its orbit has no plane; give metres and metres per second in ECI"
        )


def write_table(
    path: Path,
    epoch_utc: str,
    arrays: Mapping[str, AnyArray],
    extras: Mapping[str, FloatArray] | None = None,
) -> None:
    """Write arrays of F rows atomically. Reading them returns every number equal to the bit.

    Args:
        path: an ``.npz`` or ``.csv`` file.
        epoch_utc: the instant of t_s = 0, ISO 8601.
        arrays: arrays by name; the names determine the shapes.
        extras: extras by name, (F, ...) each.

    Raises:
        InputError: The file's name ends in neither ``.npz`` nor ``.csv``.
    """
    more = {_EXTRA + name: array for name, array in (extras or {}).items()}
    match path.suffix:
        case ".npz":
            members: dict[str, Any] = {"epoch_utc": np.array(epoch_utc), **arrays, **more}
            with atomic_file(path) as stream:
                np.savez(stream, **members)
        case ".csv":
            text = io.StringIO()
            rows = csv.writer(text, lineterminator="\n")
            header = [column for name in arrays for column in _columns(name)]
            header += [name + suffix for name, x in more.items() for suffix in _suffixes(x.shape[1:])]
            rows.writerow(["epoch_utc", *header])
            flat = [part for x in [*arrays.values(), *more.values()] for part in x.reshape(len(x), -1).T]
            for row in zip(*(part.tolist() for part in flat), strict=True):
                rows.writerow([epoch_utc, *row])
            with atomic_file(path) as stream:
                stream.write(text.getvalue().encode())
        case _:
            raise _unknown_suffix(path)


def _columns(name: str) -> list[str]:
    """Return the names of an array's columns in a CSV file."""
    return [name + suffix for suffix in _SUFFIXES.get(name.split("_")[0], ("",))]


def _suffixes(shape: tuple[int, ...]) -> list[str]:
    """Return the suffixes of the CSV columns of an extra that has this shape in each row."""
    return ["".join(f"[{k}]" for k in index) for index in np.ndindex(shape)]


_Read = tuple[tuple[str, ...], str | None, dict[str, AnyArray], dict[str, AnyArray]]
"""The names in the file, the epoch, the arrays by name, and the extras by name."""


def _read_npz(path: Path, names: Collection[str], extras: bool) -> _Read:
    def wanted(name: str) -> bool:
        return name == "epoch_utc" or name in names or (extras and name.startswith(_EXTRA))

    there: list[str] = []

    def noted(name: str) -> bool:
        there.append(name)
        return wanted(name)

    found = read_npz(path, noted, _MISSING)
    epoch_utc = str(found["epoch_utc"]) if "epoch_utc" in found else None
    arrays = {name: np.atleast_1d(found[name]) for name in names if name in found}
    more = [name for name in found if name not in arrays and name.startswith(_EXTRA)]
    return (
        tuple(there),
        epoch_utc,
        arrays,
        {name[len(_EXTRA) :]: np.atleast_1d(found[name]) for name in more},
    )


def _read_csv(path: Path, names: Collection[str], extras: bool) -> _Read:
    lines = io.StringIO(read_text(path, _MISSING), newline="")
    header, *rows = [row for row in csv.reader(lines, skipinitialspace=True) if row] or [[]]
    index_of = {column: index for index, column in enumerate(header)}

    def column_of(name: str) -> FloatArray:
        return _numbers(rows, name, index_of[name], path)

    arrays: dict[str, AnyArray] = {}
    for name in names:
        columns = _columns(name)
        if all(column in index_of for column in columns):
            parts = [column_of(column) for column in columns]
            arrays[name] = np.stack(parts, axis=-1) if len(parts) > 1 else parts[0]
    more: dict[str, AnyArray] = {}
    for name, shape in (_extra_shapes(header) if extras else {}).items():
        if math.prod(shape) > len(header):
            raise InputError(
                f"{path} has fewer columns of {_EXTRA + name} than the last one's index says"
            )
        wanted = [_EXTRA + name + suffix for suffix in _suffixes(shape)]
        missing = next((column for column in wanted if column not in index_of), None)
        if missing is not None:
            raise InputError(
                f"{path} has no column {missing!r}, although it has others of {_EXTRA + name}"
            )
        parts = [column_of(column) for column in wanted]
        more[name] = np.stack(parts, axis=-1).reshape(len(rows), *shape)
    epochs = [row[at : at + 1] for row in rows[:1] if (at := index_of.get("epoch_utc")) is not None]
    epoch_utc = epochs[0][0] if epochs and epochs[0] else None
    return tuple(header), epoch_utc, arrays, more


def _extra_shapes(header: list[str]) -> dict[str, tuple[int, ...]]:
    """Return the shape of each extra in a row, derived from the last index among its column names."""
    shapes: dict[str, tuple[int, ...]] = {}
    for column in header:
        if match := _EXTRA_COLUMN.fullmatch(column):
            shapes[match[1]] = tuple(int(k) + 1 for k in re.findall(r"\d+", match[2]))
    return shapes


def _numbers(rows: list[list[str]], column: str, index: int, path: Path) -> FloatArray:
    try:
        return np.array([row[index] for row in rows], dtype=np.float64)
    except IndexError:
        raise InputError(f"{path}: a row has no value in column {column!r}") from None
    except ValueError as error:
        raise InputError(f"{path}: column {column!r}: {error}") from None


def _unknown_suffix(path: Path) -> InputError:
    return InputError(f"{path}: the name of a trajectory file must end in .npz or .csv")
