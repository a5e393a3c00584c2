"""Saving and loading trajectories."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._errors import InputError
from posse_core._files.tables import check_orbit, read_table, write_table
from posse_core._model.trajectory import TRAJECTORY_ARRAYS, Trajectory


def save_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write the fields of a :class:`Trajectory` to an ``.npz`` or ``.csv`` file (see ``tables``).

    Raises:
        InputError: The file's name has another suffix.
    """
    write_table(path, trajectory.epoch_utc, trajectory.arrays(), trajectory.extras)


def load_trajectory(path: Path) -> Trajectory:
    """Read a file that :func:`save_trajectory` wrote; every number is equal to the bit.

    Raises:
        InputError: The file is missing or of another kind, lacks a field, or has a value that is not a
            finite number, or an epoch that is none; the message names the file and the field.
    """
    table = read_table(path, TRAJECTORY_ARRAYS, extras=True)
    if table.epoch_utc is None or table.epoch is None:
        raise InputError(f"{path} has no 'epoch_utc'; files made by 'posse propagate' have it")
    arrays: dict[str, AnyArray] = {name: table[name] for name in TRAJECTORY_ARRAYS}
    check_orbit(path, table["r_target_eci_m"], table["v_target_eci_m_s"])
    arrays["sequence"] = arrays["sequence"].astype(np.int64)
    return Trajectory(epoch_utc=table.epoch_utc, **arrays, extras=table.extras)
