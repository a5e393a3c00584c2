"""Two-line element sets (TLE): checking their lines, and computing their states by SGP4.

Format: Vallado et al. (2006), AIAA 2006-6753, and CelesTrak's description of NORAD element sets.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sgp4.api import SGP4_ERRORS, WGS72, Satrec

from posse_core._arrays import FloatArray
from posse_core._dynamics.elements import (
    equinoctial_from_state,
    equinoctial_sign,
    keplerian_from_qns,
    later,
    qns_from_equinoctial,
)
from posse_core._environment.earth import R_gcrf_from_teme
from posse_core._environment.time import Epoch
from posse_core._errors import InputError

_LENGTH = 69
_MU_WGS72_M3_S2 = 3.986008e14
_CORRECTIONS = 8
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
    """The mean elements in the two lines, in radians: those of SGP4's theory, in TEME axes."""

    i_rad: float
    raan_rad: float
    e: float
    argp_rad: float
    mean_anomaly_rad: float
    mean_motion_rad_s: float


class Sgp4Orbit:
    """An orbit computed by SGP4 (by SDP4 for periods above 225 minutes).

    Attributes:
        epoch: the epoch of its elements.
    """

    def __init__(self, satellite: Any, epoch: Epoch, where: str) -> None:
        self._satellite = satellite
        self._where = where
        self.epoch = epoch

    def state(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position (m) and velocity (m/s), GCRF axes: (F,) SI seconds after the epoch → (F, 3) each.

        Raises:
            InputError: SGP4 fails at one of the times, such as for a decayed orbit.
        """
        days = np.asarray(t_s, dtype=np.float64) / 86400.0
        error, r_km, v_km_s = self._satellite.sgp4_array(
            np.full_like(days, self.epoch.jd1_utc), self.epoch.jd2_utc + days
        )
        if np.any(error):
            k = int(np.argmax(error != 0))
            raise InputError(
                f"{self._where}: SGP4 fails at t_s = {float(t_s[k]):g}: {SGP4_ERRORS[int(error[k])]};"
                " use an element set of a nearer date"
            )
        R = R_gcrf_from_teme(*self.epoch.tt(t_s))
        r_m = np.einsum("fij,fj->fi", R, np.asarray(r_km)) * 1e3
        v_m_s = np.einsum("fij,fj->fi", R, np.asarray(v_km_s)) * 1e3
        return r_m, v_m_s


class Tle(Sgp4Orbit):
    """A two-line element set, whose lines are checked.

    Raises:
        InputError: A line has a wrong length, number, format or checksum, the two satellite numbers
            differ, or SGP4 refuses the elements; the message names the line.
    """

    def __init__(self, lines: Sequence[str], where: str = "orbit.tle") -> None:
        line_1, line_2 = (_checked(line, n + 1, where) for n, line in enumerate(lines))
        if line_1[2:7] != line_2[2:7]:
            raise InputError(
                f"{where}: line 1 is of satellite {line_1[2:7].strip()},"
                f" line 2 of {line_2[2:7].strip()}; copy both from one element set"
            )
        try:
            satellite: Any = Satrec.twoline2rv(line_1, line_2, WGS72)
        except ValueError as error:
            raise InputError(f"{where}: SGP4 cannot read it: {error}") from error
        super().__init__(satellite, Epoch(satellite.jdsatepoch, satellite.jdsatepochF), where)
        self.state(np.zeros(1))

    @property
    def mean(self) -> MeanElements:
        """The elements as the lines state them."""
        s = self._satellite
        return MeanElements(s.inclo, s.nodeo, s.ecco, s.argpo, s.mo, s.no_kozai / 60.0)

    def neighbour(self, r_m: FloatArray, v_m_s: FloatArray, at_s: float) -> Sgp4Orbit:
        """Return an orbit with the same drag that has a given state ``at_s`` seconds after the epoch.

        Its mean elements are found by iteration: each step corrects them by the difference of the
        osculating elements, which reduces the error to about a thousandth (J2).

        Args:
            r_m, v_m_s: (3,) position and velocity, GCRF axes.
            at_s: seconds after the epoch.

        Raises:
            InputError: SGP4 has no orbit with this state.
        """
        R = R_gcrf_from_teme(*self.epoch.tt(np.asarray(at_s)))
        r, v = R.T @ r_m, R.T @ v_m_s
        sign = equinoctial_sign(r, v)
        wanted = equinoctial_from_state(r, v, sign, _MU_WGS72_M3_S2)
        mean = later(wanted, _MU_WGS72_M3_S2, np.asarray(-at_s))
        for _ in range(_CORRECTIONS):
            satellite = self._with(keplerian_from_qns(qns_from_equinoctial(mean, sign)))
            error, r_km, v_km_s = satellite.sgp4_tsince(at_s / 60.0)
            if error:
                raise InputError(f"{self._where}: SGP4 on the chaser's orbit: {SGP4_ERRORS[error]}")
            got = equinoctial_from_state(
                np.array(r_km) * 1e3, np.array(v_km_s) * 1e3, sign, _MU_WGS72_M3_S2
            )
            missing = wanted - got
            missing[1] -= 2 * np.pi * np.round(missing[1] / (2 * np.pi))
            mean = mean + missing
        return Sgp4Orbit(satellite, self.epoch, self._where)

    def _with(self, keplerian: FloatArray) -> Any:
        """The same satellite with other mean elements."""
        a_m, e, i, raan, argp, mean_anomaly = keplerian
        own, other = self._satellite, Satrec()
        other.sgp4init(
            WGS72,
            own.operationmode,
            own.satnum,
            own.jdsatepoch + own.jdsatepochF - 2433281.5,
            own.bstar,
            own.ndot,
            own.nddot,
            e,
            argp % (2 * np.pi),
            i,
            mean_anomaly % (2 * np.pi),
            60.0 * np.sqrt(_MU_WGS72_M3_S2 / a_m**3),
            raan % (2 * np.pi),
        )
        other.jdsatepoch, other.jdsatepochF = own.jdsatepoch, own.jdsatepochF
        return other


def _checked(line: str, number: int, where: str) -> str:
    line = line.rstrip()
    which = f"{where}: line {number}"
    if len(line) != _LENGTH:
        raise InputError(
            f"{which} has {len(line)} characters, not {_LENGTH}; copy the whole line, blanks included"
        )
    if line[0] != str(number):
        raise InputError(f"{which} begins with {line[0]!r}, not with {str(number)!r}; check the order")
    wanted = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1] if c.isascii()) % 10
    if line[-1] != str(wanted):
        raise InputError(
            f"{which} has the checksum {line[-1]!r}, its characters give {wanted}; copy it again"
        )
    if not _LINES[number - 1].fullmatch(line):
        raise InputError(f"{which} does not have the columns of a two-line element set; copy it again")
    return line
