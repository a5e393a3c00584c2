"""CCSDS Orbit Ephemeris Messages in keyword notation (CCSDS 502.0-B-3, section 5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from posse_core._arrays import BoolArray, FloatArray
from posse_core._environment.earth import R_GCRF_FROM_EME2000, R_gcrf_from_teme
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.ccsds import data_lines
from posse_core._files.interpolation import SAME_INSTANT_S, Method, path_at

FRAMES = ("GCRF", "ICRF", "EME2000", "J2000", "TEME")


_METHODS = ("HERMITE", "LAGRANGE", "LINEAR")
_HIGHEST_DEGREE = 21
_DEGREE = {"HERMITE": 7, "LAGRANGE": 8, "LINEAR": 1}
"""Degrees of polynomials where the file does not say."""


@dataclass(frozen=True)
class Segment:
    """A piece of a path that is interpolated for itself.

    Attributes:
        t_s: (N,) SI seconds after the epoch that the caller gave, increasing.
        r_eci_m, v_eci_m_s: (N, 3) position [m] and velocity [m/s] in GCRF axes.
        method, degree: how it is interpolated.
    """

    t_s: FloatArray
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray
    method: Method
    degree: int


@dataclass(frozen=True)
class Ephemeris:
    """The path of an object.

    Attributes:
        path: the file.
        t_s: (F,) SI seconds after the epoch that the caller gave, increasing.
        r_eci_m, v_eci_m_s: (F, 3) position [m] and velocity [m/s] in GCRF axes.
        segments: the same by segments, in the file's order.
    """

    path: Path
    t_s: FloatArray
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray
    segments: tuple[Segment, ...]

    def covers(self, t_s: FloatArray) -> BoolArray:
        """(F,) whether each time is within a segment, to a microsecond."""
        inside: list[BoolArray] = [
            (t_s >= each.t_s[0] - SAME_INSTANT_S) & (t_s <= each.t_s[-1] + SAME_INSTANT_S)
            for each in self.segments
        ]
        covered: BoolArray = np.any(inside, axis=0)
        return covered

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(F, 3) positions and (F, 3) velocities at (F,) times, which segments cover.

        A time that two segments cover belongs to the later one in the file.
        """
        r, v = np.full((2, len(t_s), 3), np.nan)
        for each in self.segments:
            mine = (t_s >= each.t_s[0] - SAME_INSTANT_S) & (t_s <= each.t_s[-1] + SAME_INSTANT_S)
            r[mine], v[mine] = path_at(
                each.t_s, each.r_eci_m, each.v_eci_m_s, t_s[mine], each.method, each.degree
            )
        return r, v


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
    segments: list[tuple[Mapping[str, str], dict[float, FloatArray]]] = []
    known = {"CENTER_NAME": ("EARTH",), "REF_FRAME": FRAMES}
    for line in data_lines(path, "OEM", epoch, known):
        if len(line.numbers) not in (6, 9):
            raise InputError(f"{line.source}: a state is an epoch and 6 numbers (km, km/s), or 9")
        r_and_v = line.numbers[:6].reshape(2, 3) * 1e3
        state = (r_and_v @ _R_gcrf_from(line.meta["REF_FRAME"], epoch, line.t_s).T).ravel()
        rows[line.t_s] = state
        if not segments or segments[-1][0] is not line.meta:
            segments.append((line.meta, {}))
        segments[-1][1][line.t_s] = state
    if not rows:
        raise InputError(f"{path}: contains no states")
    pieces = tuple(_segment(path, *segment) for segment in segments)
    return Ephemeris(path, *_in_order(rows), pieces)


def _in_order(rows: Mapping[float, FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray]:
    instants = sorted(rows)
    states = np.stack([rows[instant] for instant in instants])
    return np.array(instants), states[:, :3], states[:, 3:]


def _segment(path: Path, meta: Mapping[str, str], rows: Mapping[float, FloatArray]) -> Segment:
    method, degree = meta.get("INTERPOLATION", "HERMITE"), meta.get("INTERPOLATION_DEGREE")
    if method not in _METHODS:
        raise InputError(f"{path}: INTERPOLATION is {method!r}; supported values: {', '.join(_METHODS)}")
    degree = str(_DEGREE[method]) if degree is None or method == "LINEAR" else degree
    if not degree.isdecimal() or not 1 <= int(degree) <= _HIGHEST_DEGREE:
        raise InputError(
            f"{path}: INTERPOLATION_DEGREE is {degree!r}; a whole number from 1 to {_HIGHEST_DEGREE} is"
            " needed"
        )
    return Segment(*_in_order(rows), cast(Method, method), int(degree))


def first_epoch(path: Path) -> Epoch:
    """The epoch of an OEM's first state.

    Raises:
        InputError: see :func:`read_oem`.
    """
    near = Epoch.from_iso("2000-01-01T12:00:00")
    for _ in range(2):  # seconds since 2000 are not exact to the nanosecond, but those since near it are
        near = Epoch.from_iso(near.shifted(float(read_oem(path, near).t_s[0])).iso())
    return near


def _R_gcrf_from(frame: str, epoch: Epoch, t_s: float) -> FloatArray:
    if frame == "TEME":
        return R_gcrf_from_teme(*epoch.tt(np.asarray(t_s)))
    return R_GCRF_FROM_EME2000 if frame in ("EME2000", "J2000") else np.eye(3)
