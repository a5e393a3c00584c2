"""Two-line element sets: checked line by line, and their state by SGP4.

Format: Vallado et al. (2006), AIAA 2006-6753, and CelesTrak's description of NORAD element sets.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sgp4.api import SGP4_ERRORS, WGS72, Satrec

from posse_core.environment.earth import R_gcrf_from_teme
from posse_core.environment.time import Epoch
from posse_core.errors import InputError
from posse_core.model.arrays import FloatArray

_LENGTH = 69
_LINES = (
    re.compile(
        r"1 [0-9A-HJ-NP-Z ][0-9 ]{3}\d[A-Z ] .{8} [0-9 ]{2}[0-9. ]{12} "
        r"[-+ 0-9.]{10} [-+ ]\d{5}[-+ ]\d [-+ ]\d{5}[-+ ]\d [0-9 ] [ 0-9]{4}\d"
    ),
    re.compile(
        r"2 [0-9A-HJ-NP-Z ][0-9 ]{3}\d [ \d]{3}\.[\d ]{4} [ \d]{3}\.[\d ]{4} \d{7}"
        r" [ \d]{3}\.[\d ]{4} [ \d]{3}\.[\d ]{4} [ \d]{2}\.[\d ]{8}[ \d]{5}\d"
    ),
)


@dataclass(frozen=True)
class MeanElements:
    """What the two lines say, in radians; mean elements of SGP4's theory, in TEME axes."""

    i_rad: float
    raan_rad: float
    e: float
    argp_rad: float
    mean_anomaly_rad: float
    mean_motion_rad_s: float


class Tle:
    """A two-line element set, read and checked.

    Raises:
        InputError: a line's length, number, columns, checksum, or the two satellite numbers are
            wrong, or SGP4 refuses the elements; the message names the line.
    """

    def __init__(self, lines: Sequence[str], where: str = "orbit.tle") -> None:
        line_1, line_2 = (_checked(line, n + 1, where) for n, line in enumerate(lines))
        if line_1[2:7] != line_2[2:7]:
            raise InputError(
                f"{where}: line 1 is of satellite {line_1[2:7].strip()},"
                f" line 2 of {line_2[2:7].strip()}; take both from one element set"
            )
        try:
            self._satellite: Any = Satrec.twoline2rv(line_1, line_2, WGS72)
        except ValueError as error:
            raise InputError(f"{where}: SGP4 cannot read it: {error}") from error
        self._where = where
        self.epoch = Epoch(self._satellite.jdsatepoch, self._satellite.jdsatepochF)
        self.state(np.zeros(1))

    @property
    def mean(self) -> MeanElements:
        """The elements as they stand in the lines."""
        s = self._satellite
        return MeanElements(s.inclo, s.nodeo, s.ecco, s.argpo, s.mo, s.no_kozai / 60.0)

    def state(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position (m) and velocity (m/s) by SGP4 or SDP4, GCRF axes: (F,) → (F, 3) each.

        Args:
            t_s: SI seconds after the epoch of the lines.

        Raises:
            InputError: SGP4 ends in an error at one of the times, such as a decayed orbit.
        """
        days = np.asarray(t_s, dtype=np.float64) / 86400.0
        error, r_km, v_km_s = self._satellite.sgp4_array(
            np.full_like(days, self.epoch.jd1_utc), self.epoch.jd2_utc + days
        )
        if np.any(error):
            k = int(np.argmax(error != 0))
            raise InputError(
                f"{self._where}: SGP4 fails at t_s = {float(t_s[k]):g}: {SGP4_ERRORS[int(error[k])]};"
                " take an element set of a nearer date"
            )
        R = R_gcrf_from_teme(*self.epoch.tt(t_s))
        r_m = np.einsum("fij,fj->fi", R, np.asarray(r_km)) * 1e3
        v_m_s = np.einsum("fij,fj->fi", R, np.asarray(v_km_s)) * 1e3
        return r_m, v_m_s


def _checked(line: str, number: int, where: str) -> str:
    line = line.rstrip()
    place = f"{where}: line {number}"
    if len(line) != _LENGTH:
        raise InputError(
            f"{place} has {len(line)} characters, not {_LENGTH}; copy the whole line, blanks included"
        )
    if line[0] != str(number):
        raise InputError(f"{place} begins with {line[0]!r}, not with {str(number)!r}; check the order")
    wanted = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1] if c.isascii()) % 10
    if line[-1] != str(wanted):
        raise InputError(
            f"{place} has the checksum {line[-1]!r}, its characters give {wanted}; copy it again"
        )
    if not _LINES[number - 1].fullmatch(line):
        raise InputError(f"{place} does not have a two-line element set's columns; copy it again")
    return line
