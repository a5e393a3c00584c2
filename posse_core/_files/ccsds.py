"""CCSDS navigation messages in keyword notation: metadata blocks, data lines and epochs.

Orbit Ephemeris Messages (CCSDS 502.0-B-3) and Attitude Ephemeris Messages (504.0-B-2) share this syntax.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import erfa
import numpy as np

from posse_core._arrays import FloatArray
from posse_core._environment.time import SECONDS_PER_DAY, Epoch
from posse_core._errors import InputError
from posse_core._files.reading import read_text

TIME_SYSTEMS = ("UTC", "TAI", "TT", "GPS")
_MINUS_TAI_S = {"TAI": 0.0, "TT": 32.184, "GPS": -19.0}
_DATE = re.compile(
    r"(\d{4})-(?:(\d{3})|(\d\d)-(\d\d))T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z?"
)  # both calendar forms of CCSDS 301.0-B-4
_FRAMING = ("DATA_START", "DATA_STOP")


@dataclass(frozen=True)
class DataLine:
    """One data line of a message.

    Attributes:
        source: file and line number, for error messages.
        meta: keywords and values of the metadata block that the line belongs to, values in upper case.
        t_s: SI seconds after the epoch that the caller gave.
        numbers: the finite numbers after the line's epoch.
    """

    source: str
    meta: Mapping[str, str]
    t_s: float
    numbers: FloatArray


def data_lines(
    path: Path, message: str, epoch: Epoch, known: Mapping[str, Sequence[str]]
) -> Iterator[DataLine]:
    """Yield the data lines of a message in the file's order, without comments and covariances.

    Args:
        path: the message file.
        message: ``OEM`` or ``AEM``.
        epoch: the instant of t_s = 0.
        known: keyword → values that the caller accepts. Every metadata block must have each keyword.

    Raises:
        InputError: The file is of another kind, or has a line or keyword that cannot be used; the
            message names the file and the line.
    """
    lines = read_text(path).splitlines()
    if not lines or not re.match(rf"\s*CCSDS_{message}_VERS\s*=", lines[0]):
        raise InputError(
            f"{path}: does not begin with CCSDS_{message}_VERS; give an {message} in keyword notation"
        )
    meta: dict[str, str] = {}
    inside = skipping = False
    for number, line in enumerate(lines, 1):
        text, source = line.strip(), f"{path}, line {number}"
        if not text or text.startswith("COMMENT") or text in _FRAMING:
            continue
        if text == "META_START":
            meta, inside = {}, True
        elif text == "META_STOP":
            _check_meta(meta, {"TIME_SYSTEM": TIME_SYSTEMS, **known}, source)
            inside = False
        elif text in ("COVARIANCE_START", "COVARIANCE_STOP"):
            skipping = text == "COVARIANCE_START"
        elif "=" in text:
            key, _, value = text.partition("=")
            if inside:
                meta[key.strip()] = value.strip().upper()
        elif not skipping:
            if inside or not meta:
                raise InputError(f"{source}: data line before the first META block, or within one")
            yield _data_line(text, meta, epoch, source)


def _check_meta(meta: Mapping[str, str], known: Mapping[str, Sequence[str]], source: str) -> None:
    for key, values in known.items():
        if meta.get(key) not in values:
            given = repr(meta[key]) if key in meta else "missing"
            raise InputError(f"{source}: {key} is {given}; supported values: {', '.join(values)}")


def _data_line(text: str, meta: Mapping[str, str], epoch: Epoch, source: str) -> DataLine:
    words = text.split()
    try:
        numbers = np.array([float(word) for word in words[1:]])
    except ValueError:
        numbers = np.array([np.nan])
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{source}: a data line must be an epoch followed by finite numbers")
    return DataLine(source, meta, _seconds(words[0], meta["TIME_SYSTEM"], epoch, source), numbers)


def _seconds(text: str, system: str, epoch: Epoch, source: str) -> float:
    match = _DATE.fullmatch(text)
    if match is None:
        raise InputError(f"{source}: the epoch {text!r} is not of the form 2022-01-31T02:02:27.58")
    year, day_of_year, month, day, hour, minute = (int(part or 0) for part in match.groups()[:6])
    if day_of_year:
        month, day = 1, 1
    scale = b"UTC" if system == "UTC" else b"TAI"
    jd1, jd2, status = erfa.ufunc.dtf2d(scale, year, month, day, hour, minute, float(match[7]))
    if status < 0:
        raise InputError(f"{source}: the epoch {text!r} does not exist")
    jd1 = jd1 + max(day_of_year - 1, 0)
    minus_tai_s = 0.0
    if system == "UTC":
        jd1, jd2, _ = erfa.ufunc.utctai(jd1, jd2)
    else:
        minus_tai_s = _MINUS_TAI_S[system]
    tai1, tai2, _ = erfa.ufunc.utctai(epoch.jd1_utc, epoch.jd2_utc)
    return float(((jd1 - tai1) + (jd2 - tai2)) * SECONDS_PER_DAY - minus_tai_s)
