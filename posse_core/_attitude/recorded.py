"""Attitudes that another program or a flight recorded, interpolated at a constant rate of rotation.

They are read from a CCSDS Attitude Ephemeris Message (504.0-B-2, and its first issue), or from an
``.npz`` or ``.csv`` file with the names that ``posse propagate`` writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._attitude.options import FileOptions
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
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings

_INERTIAL = ("GCRF", "ICRF", "EME2000", "J2000")
_QUATERNION_LENGTH_ERROR = 1e-3
"""Largest allowed difference of a quaternion's length from 1."""
_EXTRAPOLATION_S = 0.01
"""How far a time may lie before the first or after the last recorded attitude."""


class FileLaw(AttitudeLaw[FileOptions]):
    """Recorded attitudes, interpolated at a constant rate from one to the next.

    The file is read when the first attitude is asked for.
    """

    def __init__(self, options: FileOptions) -> None:
        super().__init__(options)
        self._recording = cache(partial(Recording.read, options.path))

    def attitude(self, around: Surroundings) -> FloatArray:
        """See :meth:`AttitudeLaw.attitude`.

        Raises:
            InputError: The file cannot be used, or does not cover all times.
        """
        name = "q_eci_from_body" if around.subject == "target" else "q_eci_from_camera"
        return self._recording(name, around.epoch).at(around.t_s)


@dataclass(frozen=True, eq=False)
class Recording:
    """Attitudes of a file.

    Attributes:
        path: the file, for messages.
        t_s: (N,) increasing times, seconds after an epoch.
        R_eci_from_x: (N, 3, 3) from body or camera axes to GCRF axes.
    """

    path: Path
    t_s: FloatArray
    R_eci_from_x: FloatArray

    @classmethod
    def read(cls, path: Path, name: str, epoch: Epoch) -> Recording:
        """Read the attitudes.

        Args:
            path: the file of attitudes.
            name: the array in an ``.npz`` or ``.csv`` file, such as ``q_eci_from_body``.
            epoch: the instant of t_s = 0.

        Raises:
            InputError: The file cannot be used.
        """
        if path.suffix in (".npz", ".csv"):
            table = read_table(path, ("t_s", name))
            times, R = table["t_s"], _rotations(table[name], str(path))
            if table.epoch_utc is not None:
                times = times + epoch.seconds_until(Epoch.from_iso(table.epoch_utc))
        else:
            times, R = _read_aem(path, epoch)
        if np.any(np.diff(times) <= 0):
            raise InputError(f"{path}: its times do not increase; sort them and remove duplicates")
        return cls(path, times, R)

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return R_eci_from_body or R_eci_from_camera at the times: (F,) → (F, 3, 3).

        Between two recorded attitudes the rotation is about one axis, the shorter way, at a constant
        rate. The first and the last rotation continue for 0.01 s beyond the record, so that angular
        velocities can be computed there by differences.

        Raises:
            InputError: The recording does not cover all times.
        """
        times, R = self.t_s, self.R_eci_from_x
        outside = (t_s < times[0] - _EXTRAPOLATION_S) | (t_s > times[-1] + _EXTRAPOLATION_S)
        if np.any(outside):
            raise InputError(
                f"{self.path}: covers {times[0]:.6g} s to {times[-1]:.6g} s after the epoch, but a"
                f" frame is at {t_s[np.argmax(outside)]:.6g} s; choose times within this interval"
            )
        before = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, max(len(times) - 2, 0))
        after = np.minimum(before + 1, len(times) - 1)
        turn = rotation_vector_from_matrix(np.swapaxes(R[before], -1, -2) @ R[after])
        span = np.where(after > before, times[after] - times[before], 1.0)
        share = (t_s - times[before]) / span
        return np.asarray(R[before] @ matrix_from_rotation_vector(share[:, None] * turn))


def _rotations(q: FloatArray, source: str) -> FloatArray:
    """Convert quaternions, scalar first, (F, 4) → (F, 3, 3); ``source`` names them in messages."""
    if np.any(np.abs(np.linalg.norm(q, axis=-1) - 1) > _QUATERNION_LENGTH_ERROR):
        raise InputError(f"{source}: a quaternion is not of length one")
    return matrix_from_quaternion(q)


def _read_aem(path: Path, epoch: Epoch) -> tuple[FloatArray, FloatArray]:
    known = {"ATTITUDE_TYPE": ("QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/ANGVEL")}
    rows = {line.t_s: _attitude(line) for line in data_lines(path, "AEM", epoch, known)}
    if not rows:
        raise InputError(f"{path}: contains no attitudes")
    instants = sorted(rows)
    return np.array(instants), np.stack([rows[instant] for instant in instants])


def _attitude(line: DataLine) -> FloatArray:
    """Return the (3, 3) rotation from body axes to GCRF axes of one line of an AEM.

    A quaternion from axes A to axes B gives x_B = M x_A, where M is the matrix of a rotation of axes
    (504.0-B-2, annex). As a rotation of vectors it therefore takes components in B to components in A.
    The first issue states the direction and the position of the scalar; in the second the direction is
    always A to B and the scalar is last.
    """
    if len(line.numbers) < 4:
        raise InputError(f"{line.source}: an attitude is an epoch and at least 4 numbers")
    q = line.numbers[:4]
    if line.meta.get("QUATERNION_TYPE", "LAST") == "LAST":
        q = np.roll(q, 1)
    R_a_from_b = _rotations(q, line.source)
    frames = [line.meta.get(f"REF_FRAME_{letter}", "missing") for letter in "AB"]
    if line.meta.get("ATTITUDE_DIR", "A2B") == "B2A":
        R_a_from_b = R_a_from_b.T
    if frames[1] in _INERTIAL:
        frames, R_a_from_b = frames[::-1], R_a_from_b.T
    inertial, body = frames
    if inertial not in _INERTIAL or not body.startswith(("SC_BODY", "CAMERA", "INSTRUMENT")):
        raise InputError(
            f"{line.source}: the attitude is between {frames[0]} and {frames[1]}; supported is one of"
            f" {', '.join(_INERTIAL)} with SC_BODY, CAMERA or INSTRUMENT"
        )
    return R_GCRF_FROM_EME2000 @ R_a_from_b if inertial in ("EME2000", "J2000") else R_a_from_b
