"""URSO's poses: ``PART_poses_gt.csv`` with columns x, y, z, q1 … q4, and ``PART_images.csv`` beside it
(Proença and Gao 2020, doi:10.1109/ICRA40945.2020.9197244).

The conventions are those by which UrsoNet, of the same authors, draws a pose. Position and attitude are
in left-handed axes. The camera's axes are x right, y up, z forward. Those of the spacecraft are the
Unreal Engine's, whose y is opposite to the mesh's. The quaternion has its scalar last and describes a
rotation of axes (JPL's convention).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from posse_core._errors import InputError
from posse_core._files.reading import read_text
from posse_core._model.poses import NamedPose

_POSES = "_poses_gt.csv"
_COLUMNS = ("x", "y", "z", "q1", "q2", "q3", "q4")
_Row = dict[str, str | None]
"""A row by the names of the first line; None where it is cut short."""


def is_urso(path: Path) -> bool:
    """Say whether a file's name is that of a list of poses of URSO."""
    return path.name.endswith(_POSES)


def read_urso(path: Path) -> Iterator[NamedPose]:
    """Read the image name and pose of every row.

    Raises:
        InputError: a file cannot be read, a row lacks a number, or there are fewer names than rows.


    F = diag(1, −1, 1) converts between the left-handed axes and ours on both sides. JPL's matrix of (q1,
    q2, q3, q4) thereby becomes that of the quaternion (q4, q1, −q2, q3), and the position becomes F r.
    """
    images = path.with_name(path.name.removesuffix(_POSES) + "_images.csv")
    names = read_text(images).splitlines() if images.exists() else None
    lines = io.StringIO(read_text(path), newline="")
    for number, row in enumerate(_rows(path, csv.DictReader(lines, skipinitialspace=True))):
        x, y, z, q1, q2, q3, q4 = (_number(path, number, row, key) for key in _COLUMNS)
        if names is not None and number >= len(names):
            raise InputError(
                f"{images}: has {len(names)} names, and {path.name} more poses; add the others"
            )
        yield NamedPose(str(number) if names is None else names[number], (q4, q1, -q2, q3), (x, -y, z))


def _rows(path: Path, reader: Iterator[_Row]) -> Iterator[_Row]:
    try:
        yield from reader
    except csv.Error as error:
        raise InputError(f"{path}: not a table: {error}; export it again") from None


def _number(path: Path, number: int, row: _Row, key: str) -> float:
    if key not in row:
        known = ", ".join(str(name) for name in list(row)[:20])
        raise InputError(f"{path}: has no column {key!r}; its first line names {known}")
    try:
        return float(row[key] or "")
    except ValueError:
        raise InputError(
            f"{path}: row {number + 1}: {key} is {(row[key] or '')[:40]!r}; give a number"
        ) from None
