"""Attitudes that another program, or a flight, has recorded, turned evenly from one to the next.

From a CCSDS Attitude Ephemeris Message (504.0-B-2, and its first issue), or from ``.npz`` or ``.csv``
with the names that ``posse propagate`` writes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._environment.earth import R_GCRF_FROM_EME2000
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.ccsds import DataLine, data_lines
from posse_core._files.tables import read_table
from posse_core._frames import (
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)

_INERTIAL = ("GCRF", "ICRF", "EME2000", "J2000")
_QUATERNION_LENGTH_ERROR = 1e-3
"""Largest difference of a quaternion's length from 1."""
_EXTRAPOLATION_S = 0.01
"""How far before the first and after the last recorded attitude a time may lie."""


def recorded_attitude(path: Path, name: str, epoch: Epoch, t_s: FloatArray) -> FloatArray:
    """R_eci_from_body or R_eci_from_camera at ``t_s``: (F,) → (F, 3, 3).

    Between two recorded attitudes the turn is about one axis, by the shorter way, at an even rate;
    the first and the last turn go on for 0.01 s beyond the record, where rates of turn look.

    Args:
        name: the array in ``.npz`` and ``.csv``, such as ``q_eci_from_body``.
        epoch: of t_s = 0.

    Raises:
        InputError: the file cannot be used, or does not reach over all of ``t_s``.
    """
    if path.suffix in (".npz", ".csv"):
        table = read_table(path, ("t_s", name))
        times, R = table["t_s"], _rotations(table[name], str(path))
        if table.epoch_utc is not None:
            times = times + epoch.seconds_until(Epoch.from_iso(table.epoch_utc))
    else:
        times, R = _read_aem(path, epoch)
    if np.any(np.diff(times) <= 0):
        raise InputError(f"{path}: its times do not increase; sort them, and keep one of each")
    outside = (t_s < times[0] - _EXTRAPOLATION_S) | (t_s > times[-1] + _EXTRAPOLATION_S)
    if np.any(outside):
        raise InputError(
            f"{path}: reaches from {times[0]:.6g} s to {times[-1]:.6g} s after the epoch, and a"
            f" frame is at {t_s[np.argmax(outside)]:.6g} s; choose times within it"
        )
    before = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(before + 1, len(times) - 1)
    turn = rotation_vector_from_matrix(np.swapaxes(R[before], -1, -2) @ R[after])
    span = np.where(after > before, times[after] - times[before], 1.0)
    share = (t_s - times[before]) / span
    return np.asarray(R[before] @ matrix_from_rotation_vector(share[:, None] * turn))


def _rotations(q: FloatArray, place: str) -> FloatArray:
    """Quaternions, scalar first, (F, 4) → (F, 3, 3)."""
    if np.any(np.abs(np.linalg.norm(q, axis=-1) - 1) > _QUATERNION_LENGTH_ERROR):
        raise InputError(f"{place}: a quaternion is not of length one")
    return matrix_from_quaternion(q)


def _read_aem(path: Path, epoch: Epoch) -> tuple[FloatArray, FloatArray]:
    known = {"ATTITUDE_TYPE": ("QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/ANGVEL")}
    rows = {line.t_s: _attitude(line) for line in data_lines(path, "AEM", epoch, known)}
    if not rows:
        raise InputError(f"{path}: has no attitudes")
    instants = sorted(rows)
    return np.array(instants), np.stack([rows[instant] for instant in instants])


def _attitude(line: DataLine) -> FloatArray:
    """(3, 3) GCRF axes from the body's, of one line of an AEM.

    A quaternion from frame A to frame B gives x_B = M x_A, M the matrix of a turn of axes (504.0-B-2,
    annex): so as a turn of vectors it is A's axes from B's. The first issue names the direction and
    the place of the scalar; the second has A to B, and the scalar last.
    """
    if len(line.numbers) < 4:
        raise InputError(f"{line.place}: an attitude has an epoch and at least 4 numbers")
    q = line.numbers[:4]
    if line.meta.get("QUATERNION_TYPE", "LAST") == "LAST":
        q = np.roll(q, 1)
    R_a_from_b = _rotations(q, line.place)
    frames = [line.meta.get(f"REF_FRAME_{letter}", "missing") for letter in "AB"]
    if line.meta.get("ATTITUDE_DIR", "A2B") == "B2A":
        R_a_from_b = R_a_from_b.T
    if frames[1] in _INERTIAL:
        frames, R_a_from_b = frames[::-1], R_a_from_b.T
    inertial, body = frames
    if inertial not in _INERTIAL or not body.startswith(("SC_BODY", "CAMERA", "INSTRUMENT")):
        raise InputError(
            f"{line.place}: the attitude is between {frames[0]} and {frames[1]}; known here is one of"
            f" {', '.join(_INERTIAL)} with SC_BODY, CAMERA or INSTRUMENT"
        )
    return R_GCRF_FROM_EME2000 @ R_a_from_b if inertial in ("EME2000", "J2000") else R_a_from_b
