"""The label lines of a dataset: located when the dataset is opened, and read when they are accessed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

from posse_core._errors import InputError
from posse_core._files.reading import check_file, parsed_json

_INDEX_LIMIT = 10**15
_WHOLE = re.compile(rb'\{"index": ?(\d{1,15})[,}].*\}\n', re.DOTALL)


class LabelLines:
    """The lines in a folder ``labels``, in ascending order of frame indices.

    Only the start of each line is kept in memory. A last line without a line feed was interrupted when a
    run was killed, so its frame is not complete and is ignored.

    Attributes:
        indices: (F,) int64, ascending; an index that has two lines occurs twice.
        damaged: ``"shard, line n"`` of each complete line that is not a label line.

    Raises:
        InputError: A shard is not a file.
    """

    def __init__(self, folder: Path) -> None:
        self._shards = sorted(folder.glob("shard-*.jsonl"))
        self.damaged: list[str] = []
        entries: list[tuple[int, int, int]] = []
        for shard, path in enumerate(self._shards):
            check_file(path)
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
    """Return the frame index of a line, or None if it is not a label line.

    A line that begins and ends as a run writes it is not parsed, which makes opening large datasets
    faster. A fault inside such a line is found when the line is read.
    """
    if match := _WHOLE.fullmatch(line):
        return int(match[1])
    try:
        index = parsed_json(line, "a label line")["index"]
    except (InputError, KeyError, TypeError):
        return None
    return index if type(index) is int and 0 <= index < _INDEX_LIMIT else None
