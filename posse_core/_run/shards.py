"""The labels on disk: append-only shards of JSON lines, and the checksums of the frames' files.

A frame is complete when its whole line is in a shard. Before the line, the frame's files are written,
and then a block of checksums: a row for each file and a seal, which is a checksum of these rows, the
line and the remark on the frame, and ends in this remark if there is one. A run that is interrupted at
any point therefore leaves at most one incomplete line, which is dropped. A bit that changes later is
detected in lines and in files, without parsing a line.

Lines contain only labels. They are appended as frames are completed and sorted at the end of the run, so
they are equal to the bit for any renderer, any number of workers, and any interruption of the run.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from posse_core._dataset.layout import LABELS
from posse_core._dataset.remarks import Remark
from posse_core._files.atomic import write_bytes
from posse_core._files.reading import check_file
from posse_core._model.label_line import LabelLine
from posse_core._model.manifest import CHECKSUMS

FRAMES_PER_SHARD = 1000

_LINE_START = re.compile(rb'\{"index":(\d{1,15}),')
_SEAL = re.compile(rb"# [0-9a-f]{64}  frame (\d{1,15})(?:, ([a-z -]+))?\n")


def shard_path(folder: Path, index: int) -> Path:
    """Return the shard that holds the line of frame ``index``."""
    return folder / LABELS / f"shard-{index // FRAMES_PER_SHARD:05d}.jsonl"


def whole_lines(path: Path) -> Iterator[bytes]:
    """Yield the complete lines of a file with their line breaks, without an incomplete last line."""
    if not path.exists():
        return
    check_file(path)
    with open(path, "rb") as stream:
        for line in stream:
            if line.endswith(b"\n"):
                yield line


class LabelLog:
    """Appends completed frames to the shards and checksums of one dataset."""

    def __init__(self, folder: Path, frames: int) -> None:
        self._folder = folder
        self._shards = [shard_path(folder, first) for first in range(0, frames, FRAMES_PER_SHARD)]
        (folder / LABELS).mkdir(exist_ok=True)

    def append(
        self, labels: LabelLine, digests: Mapping[str, str], remark: Remark | None = None
    ) -> bytes:
        """Append a frame whose files are complete; ``digests`` maps each file to its SHA-256.

        Returns:
            The appended lines, for :func:`replay`.
        """
        line = labels.to_json() + b"\n"
        rows = "".join(f"{digest}  {name}\n" for name, digest in digests.items())
        block = _sealed(labels.index, rows.encode(), line, remark.value.encode() if remark else None)
        _append(self._folder / CHECKSUMS, block)
        _append(shard_path(self._folder, labels.index), line)
        return block + line

    def recover(self, digest_of: Callable[[str], str], threads: int = 1) -> set[int]:
        """Find the complete frames; drop incomplete lines and frames whose files have changed.

        Args:
            digest_of: returns the current SHA-256 of a file, or raises OSError.
            threads: number of shards that are checked at a time.

        Returns:
            The indices of the complete frames.
        """
        path = self._folder / CHECKSUMS
        blocks = _blocks(path)
        with ThreadPoolExecutor(threads) as pool:
            intact = pool.map(partial(self._mend, blocks, digest_of), range(len(self._shards)))
            done = set().union(*intact)
        text = b"".join(block for index, block in blocks.items() if index in done)
        if path.exists() and path.read_bytes() != text:
            write_bytes(path, text)
        return done

    def _mend(
        self, blocks: Mapping[int, bytes], digest_of: Callable[[str], str], shard: int
    ) -> set[int]:
        """Drop incomplete frames from a shard, and return the indices of the others."""
        path = self._shards[shard]
        intact: set[int] = set()
        lines: list[bytes] = []
        for line in whole_lines(path):
            index = _index(line)
            if index in intact or index // FRAMES_PER_SHARD != shard or index not in blocks:
                continue
            if _is_intact(index, line, blocks[index], digest_of):
                intact.add(index)
                lines.append(line)
        if path.exists() and sum(map(len, lines)) != path.stat().st_size:
            write_bytes(path, b"".join(lines))
        return intact

    def remarks(self) -> Counter[Remark]:
        """Remark → number of the frames that it is made on."""
        blocks = _blocks(self._folder / CHECKSUMS).values()
        made = (_remark(block) for block in blocks)
        return Counter(Remark(words.decode()) for words in made if words is not None)

    def put_in_order(self) -> None:
        """Sort lines and checksums by frame, since workers complete frames in any order."""
        for path in self._shards:
            lines = list(whole_lines(path))
            _rewrite(path, lines, sorted(lines, key=_index))
        blocks = _blocks(self._folder / CHECKSUMS)
        ordered = [blocks[index] for index in sorted(blocks)]
        _rewrite(self._folder / CHECKSUMS, list(blocks.values()), ordered)


def replay(folder: Path, entries: bytes) -> None:
    """Append frames again from what :meth:`LabelLog.append` returned; repeating this does no harm."""
    for line in entries.splitlines(keepends=True):
        index = _index(line)
        _append(folder / CHECKSUMS if index < 0 else shard_path(folder, index), line)


def _is_intact(index: int, line: bytes, block: bytes, digest_of: Callable[[str], str]) -> bool:
    rows = block[: block.rindex(b"# ")]
    if _sealed(index, rows, line, _remark(block)) != block:
        return False
    try:
        for row in rows.decode().splitlines():
            digest, _, name = row.partition("  ")
            if digest_of(name) != digest:
                return False
    except (OSError, ValueError):  # ValueError: the row's name is damaged
        return False
    return True


def _append(path: Path, text: bytes) -> None:
    """Append text in a single write."""
    with open(path, "ab") as stream:
        stream.write(text)


def _rewrite(path: Path, parts: list[bytes], ordered: list[bytes]) -> None:
    if ordered != parts:
        write_bytes(path, b"".join(ordered))


def _index(line: bytes) -> int:
    """Return the frame index of a label line, or −1 if it is not a label line."""
    match = _LINE_START.match(line)
    return int(match[1]) if match else -1


def _sealed(index: int, rows: bytes, line: bytes, remark: bytes | None) -> bytes:
    """Return a frame's block of checksums: the rows of its files, and the seal over them, the frame's
    line and the remark on it."""
    digest = hashlib.sha256(rows + line + (remark or b"")).hexdigest().encode()
    return b"%b# %b  frame %d%b\n" % (rows, digest, index, b", " + remark if remark else b"")


def _remark(block: bytes) -> bytes | None:
    """The remark in a frame's block of checksums."""
    seal = _SEAL.search(block)
    return seal[2] if seal else None


def _blocks(path: Path) -> dict[int, bytes]:
    """Return index of a frame → its block of checksums, in the order of the file."""
    blocks: dict[int, bytes] = {}
    rows: list[bytes] = []
    for row in whole_lines(path):
        rows.append(row)
        if match := _SEAL.fullmatch(row):
            blocks[int(match[1])] = b"".join(rows)
            rows.clear()
    return blocks
