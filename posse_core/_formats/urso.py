"""URSO's poses: ``PART_poses_gt.csv`` with columns x, y, z, q1 … q4, and ``PART_images.csv`` beside it
(Proença and Gao 2020, doi:10.1109/ICRA40945.2020.9197244).

As UrsoNet, by the same authors, draws a pose: place and attitude are in left-handed axes, the camera's x
right, y up, z forward, the craft's those of the Unreal Engine, whose y is that of the mesh reversed; the
quaternion has its scalar last, and the matrix of a turn of axes (JPL's convention).
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

from posse_core._model.poses import NamedPose

_POSES = "_poses_gt.csv"


def is_urso(path: Path) -> bool:
    """Whether a file's name is one of URSO's lists of poses."""
    return path.name.endswith(_POSES)


def read_urso(path: Path) -> Iterator[NamedPose]:
    """Image and pose of every row.

    With F = diag(1, −1, 1) between the left-handed axes and ours, on both sides, JPL's matrix of
    (q1, q2, q3, q4) becomes that of the quaternion (q4, q1, −q2, q3), and the place F r.
    """
    images = path.with_name(path.name.removesuffix(_POSES) + "_images.csv")
    names = images.read_text(encoding="utf-8").splitlines() if images.exists() else None
    with open(path, newline="", encoding="utf-8") as stream:
        for number, row in enumerate(csv.DictReader(stream, skipinitialspace=True)):
            x, y, z, q1, q2, q3, q4 = (
                float(row[key]) for key in ("x", "y", "z", "q1", "q2", "q3", "q4")
            )
            name = names[number] if names else str(number)
            yield NamedPose(name, (q4, q1, -q2, q3), (x, -y, z))
