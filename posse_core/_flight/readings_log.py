"""The readings of a flight's frames, as lines of JSON, from which an interrupted flight goes on."""

from __future__ import annotations

import json
from collections.abc import Container
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._dataset.layout import READINGS
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.navigator import KeypointReading, LineOfSight, RangeReading, Readings

_PARTS = {
    "keypoints": KeypointReading,
    "pose": PoseEstimate,
    "pose_alone": PoseEstimate,
    "line_of_sight": LineOfSight,
    "range": RangeReading,
}
_LEFT_OUT = {"truth", "detection"}


class ReadingsLog:
    """Appends readings to a dataset's folder, and reads those of an earlier attempt."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / READINGS

    def recover(self, done: Container[int]) -> dict[int, Readings]:
        """Index of a frame → its readings, for the frames that are ``done``; drops all others.

        Raises:
            InputError: a line is not one that this class wrote.
        """
        if not self._path.exists():
            return {}
        lines = self._path.read_bytes().splitlines(keepends=True)
        kept: dict[int, bytes] = {}
        found: dict[int, Readings] = {}
        for line in lines:
            if line.endswith(b"\n"):
                readings = _parsed(line, self._path)
                if readings.index in done:
                    found[readings.index], kept[readings.index] = readings, line
        if list(kept.values()) != lines:
            write_bytes(self._path, b"".join(kept.values()))
        return found

    def append(self, readings: Readings) -> None:
        """Append a line."""
        line = json.dumps(_plain(readings), allow_nan=False).encode() + b"\n"
        with open(self._path, "ab") as stream:
            stream.write(line)


def _plain(record: Any) -> dict[str, Any]:
    """The fields of one of the records above as values of JSON."""
    values = {
        part.name: getattr(record, part.name) for part in fields(record) if part.name not in _LEFT_OUT
    }
    return {
        name: value.tolist()
        if isinstance(value, np.ndarray)
        else _plain(value)
        if name in _PARTS and value is not None
        else value
        for name, value in values.items()
    }


def _parsed(line: bytes, path: Path) -> Readings:
    try:
        raw = json.loads(line)
        for name, kind in _PARTS.items():
            if raw[name] is not None:
                raw[name] = kind(**_with_arrays(raw[name]))
        return Readings(**_with_arrays(raw))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{path}: a line is not the readings of a frame; fly anew") from None


def _with_arrays(raw: dict[str, Any]) -> dict[str, Any]:
    return {
        # An empty list does not say of what.
        name: np.array(value, dtype=bool if name == "inliers" else None)
        if isinstance(value, list)
        else value
        for name, value in raw.items()
    }
