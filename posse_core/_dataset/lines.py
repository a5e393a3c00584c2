"""The label lines of a dataset, found when it is opened and read when they are asked for."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

_WHOLE = re.compile(rb'\{"index": ?(\d{1,15})[,}].*\}\n', re.DOTALL)


class LabelLines:
    """The lines of a folder ``labels``, in the order of their frames' indices.

    Only where each line begins is kept, so memory does not grow with what the labels hold. A last line
    without its line feed was cut short when a run was killed: that frame was never finished.

    Attributes:
        indices: (F,) int64, ascending; an index that is labelled twice is here twice.
        damaged: ``"shard, line n"`` of each complete line that is not a label.
    """

    def __init__(self, folder: Path) -> None:
        self._shards = sorted(folder.glob("shard-*.jsonl"))
        self.damaged: list[str] = []
        entries: list[tuple[int, int, int]] = []
        for shard, path in enumerate(self._shards):
            with open(path, "rb") as stream:
                offset = 0
                for number, line in enumerate(stream, 1):
                    if not line.endswith(b"\n"):
                        break
                    index = _index_of(line)
                    if index is None:
                        self.damaged.append(f"{path.name}, line {number}")
                    else:
                        entries.append((index, shard, offset))
                    offset += len(line)
        table = np.array(entries, dtype=np.int64).reshape(-1, 3)
        table = table[np.argsort(table[:, 0], kind="stable")]
        self.indices, self._shard, self._offset = table.T

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, position: int) -> bytes:
        with open(self._shards[self._shard[position]], "rb") as stream:
            stream.seek(self._offset[position])
            return stream.readline()

    def __iter__(self) -> Iterator[bytes]:
        for shard, positions in groupby(range(len(self)), key=self._shard.__getitem__):
            with open(self._shards[shard], "rb") as stream:
                for position in positions:
                    stream.seek(self._offset[position])
                    yield stream.readline()


def _index_of(line: bytes) -> int | None:
    """Index of a line's frame; None where it is no label.

    A line that begins and ends as a run writes it is not parsed: that would take most of the time that
    opening a large dataset takes, and a fault within is found when the line is read.
    """
    if match := _WHOLE.fullmatch(line):
        return int(match[1])
    try:
        index = json.loads(line)["index"]
    except (ValueError, KeyError, TypeError):
        return None
    return index if type(index) is int and index >= 0 else None
