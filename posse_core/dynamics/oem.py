"""CCSDS Orbit Ephemeris Messages in keyword notation (CCSDS 502.0-B-3, section 5)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import erfa
import numpy as np

from posse_core.environment.earth import R_gcrf_from_teme
from posse_core.environment.time import Epoch
from posse_core.errors import InputError
from posse_core.model.arrays import FloatArray

FRAMES = ("GCRF", "ICRF", "EME2000", "J2000", "TEME")
TIME_SYSTEMS = ("UTC", "TAI", "TT", "GPS")
_SECONDS_PER_DAY = 86400.0
_AFTER_TAI_S = {"TAI": 0.0, "TT": 32.184, "GPS": -19.0}
_DATE = re.compile(
    r"(\d{4})-(?:(\d{3})|(\d\d)-(\d\d))T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z?"
)  # both of CCSDS 301.0-B-4's calendar forms


@dataclass(frozen=True)
class Ephemeris:
    """An object's path.

    Attributes:
        t_s: (F,) SI seconds after the epoch that was asked for, increasing.
        r_eci_m, v_eci_m_s: (F, 3) GCRF axes.
    """

    t_s: FloatArray
    r_eci_m: FloatArray
    v_eci_m_s: FloatArray


def read_oem(path: Path, epoch: Epoch) -> Ephemeris:
    """Read all segments of an OEM; where two meet at one instant, the later one's state stands.

    Args:
        epoch: of t_s = 0.

    Raises:
        InputError: not an OEM in keyword notation, or a frame, centre or time system that is not
            known here; the message has file and line.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not lines or not re.match(r"\s*CCSDS_OEM_VERS\s*=", lines[0]):
        raise InputError(f"{path}: does not begin with CCSDS_OEM_VERS; give an OEM in keyword notation")
    meta: dict[str, str] = {}
    inside = skipping = False
    rows: dict[float, FloatArray] = {}
    for number, line in enumerate(lines, 1):
        text, place = line.strip(), f"{path}, line {number}"
        if not text or text.startswith("COMMENT"):
            continue
        if text == "META_START":
            meta, inside = {}, True
        elif text == "META_STOP":
            _check_meta(meta, place)
            inside = False
        elif text in ("COVARIANCE_START", "COVARIANCE_STOP"):
            skipping = text == "COVARIANCE_START"
        elif "=" in text:
            key, _, value = text.partition("=")
            if inside:
                meta[key.strip()] = value.strip()
        elif not skipping:
            t_s, row = _row(text, meta, epoch, place)
            rows[t_s] = row
    if not rows:
        raise InputError(f"{path}: has no states")
    instants = sorted(rows)
    states = np.stack([rows[instant] for instant in instants])
    return Ephemeris(np.array(instants), states[:, :3], states[:, 3:])


def _check_meta(meta: dict[str, str], place: str) -> None:
    for key, known in (
        ("CENTER_NAME", ("EARTH",)),
        ("REF_FRAME", FRAMES),
        ("TIME_SYSTEM", TIME_SYSTEMS),
    ):
        if meta.get(key, "").upper() not in known:
            given = repr(meta[key]) if key in meta else "missing"
            raise InputError(f"{place}: {key} is {given}; known here: {', '.join(known)}")


def _row(text: str, meta: dict[str, str], epoch: Epoch, place: str) -> tuple[float, FloatArray]:
    if not meta:
        raise InputError(f"{place}: a state before any META block")
    words = text.split()
    try:
        numbers = np.array([float(word) for word in words[1:]])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) not in (6, 9) or not np.all(np.isfinite(numbers)):
        raise InputError(f"{place}: a state has an epoch and 6 numbers (km, km/s), or 9")
    t_s = _seconds(words[0], meta["TIME_SYSTEM"].upper(), epoch, place)
    state = np.concatenate(
        [_gcrf(v * 1e3, meta["REF_FRAME"].upper(), epoch, t_s) for v in (numbers[:3], numbers[3:6])]
    )
    return t_s, state


def _gcrf(vector: FloatArray, frame: str, epoch: Epoch, t_s: float) -> FloatArray:
    if frame == "TEME":
        return np.asarray(R_gcrf_from_teme(*epoch.tt(np.asarray(t_s))) @ vector)
    if frame in ("EME2000", "J2000"):
        bias, _, _ = erfa.bp06(erfa.DJ00, 0.0)  # 23 mas: 0.8 m in a low orbit
        return np.asarray(bias.T @ vector)
    return vector


def _seconds(text: str, system: str, epoch: Epoch, place: str) -> float:
    match = _DATE.fullmatch(text)
    if match is None:
        raise InputError(f"{place}: the epoch {text!r} is not of the form 2022-01-31T02:02:27.58")
    year, day_of_year, month, day, hour, minute = (int(part or 0) for part in match.groups()[:6])
    if day_of_year:
        month, day = 1, 1
    scale = b"UTC" if system == "UTC" else b"TAI"
    jd1, jd2, status = erfa.ufunc.dtf2d(scale, year, month, day, hour, minute, float(match[7]))
    if status < 0:
        raise InputError(f"{place}: the epoch {text!r} does not exist")
    jd1 = jd1 + max(day_of_year - 1, 0)
    after_s = 0.0
    if system == "UTC":
        jd1, jd2, _ = erfa.ufunc.utctai(jd1, jd2)
    else:
        after_s = _AFTER_TAI_S[system]
    tai1, tai2, _ = erfa.ufunc.utctai(epoch.jd1_utc, epoch.jd2_utc)
    return float(((jd1 - tai1) + (jd2 - tai2)) * _SECONDS_PER_DAY - after_s)
