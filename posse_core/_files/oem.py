"""CCSDS Orbit Ephemeris Messages in keyword notation (CCSDS 502.0-B-3, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._environment.earth import R_GCRF_FROM_EME2000, R_gcrf_from_teme
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.ccsds import data_lines

FRAMES = ("GCRF", "ICRF", "EME2000", "J2000", "TEME")


@dataclass(frozen=True)
class Ephemeris:
    """The path of an object.

    Attributes:
        t_s: (F,) SI seconds after the epoch that the caller gave, increasing.
        r_eci_m, v_eci_m_s: (F, 3) position [m] and velocity [m/s] in GCRF axes.
    """

    t_s: FloatArray
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray


def read_oem(path: Path, epoch: Epoch) -> Ephemeris:
    """Read all segments of an OEM. Where two segments share an instant, the later one's state is used.

    Args:
        path: the OEM file.
        epoch: the instant of t_s = 0.

    Raises:
        InputError: The file is not an OEM in keyword notation, or its axes, centre or time system are
            not supported; the message names the file and the line.
    """
    rows: dict[float, FloatArray] = {}
    known = {"CENTER_NAME": ("EARTH",), "REF_FRAME": FRAMES}
    for line in data_lines(path, "OEM", epoch, known):
        if len(line.numbers) not in (6, 9):
            raise InputError(f"{line.source}: a state is an epoch and 6 numbers (km, km/s), or 9")
        r_and_v = line.numbers[:6].reshape(2, 3) * 1e3
        rows[line.t_s] = (r_and_v @ _R_gcrf_from(line.meta["REF_FRAME"], epoch, line.t_s).T).ravel()
    if not rows:
        raise InputError(f"{path}: contains no states")
    instants = sorted(rows)
    states = np.stack([rows[instant] for instant in instants])
    return Ephemeris(np.array(instants), states[:, :3], states[:, 3:])


def _R_gcrf_from(frame: str, epoch: Epoch, t_s: float) -> FloatArray:
    if frame == "TEME":
        return R_gcrf_from_teme(*epoch.tt(np.asarray(t_s)))
    return R_GCRF_FROM_EME2000 if frame in ("EME2000", "J2000") else np.eye(3)
