"""The labels on disk: append-only shards of JSON lines, and the checksums of the frames' files.

A frame is done when its line stands whole in a shard. Its files and their checksums are written
before that, so a run that is cut at any point leaves at most one torn line, which is dropped.
Lines hold labels alone. They are appended as frames are done, and sorted at the end of the run: so they
are the same to the bit whichever renderer made the pictures, with any number of workers, and whatever
the run went through.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from posse_core.files import sha256, write_bytes

FRAMES_PER_SHARD = 1000
CHECKSUMS = "checksums.sha256"
"""In the format of the tool ``sha256sum``: ``sha256sum -c checksums.sha256`` checks a dataset."""


def shard_path(folder: Path, index: int) -> Path:
    """The shard that holds the line of frame ``index``."""
    return folder / "labels" / f"shard-{index // FRAMES_PER_SHARD:05d}.jsonl"


def frame_files(labels: Mapping[str, Any]) -> list[str]:
    """Relative paths of a frame's files, from its labels."""
    return [labels[key] for key in ("image", "truth") if labels.get(key)]


def whole_lines(path: Path) -> Iterator[bytes]:
    """The complete lines of a file, each with its line break; a torn last one is left out."""
    if not path.exists():
        return
    with open(path, "rb") as stream:
        for line in stream:
            if line.endswith(b"\n"):
                yield line


def append_line(path: Path, line: str) -> None:
    """Add one line in a single write."""
    with open(path, "ab") as stream:
        stream.write(line.encode() + b"\n")


class LabelLog:
    """Appends finished frames to the shards of one dataset."""

    def __init__(self, folder: Path, frames: int) -> None:
        self._folder = folder
        self._shards = [shard_path(folder, first) for first in range(0, frames, FRAMES_PER_SHARD)]
        (folder / "labels").mkdir(exist_ok=True)

    def append(self, labels: Mapping[str, Any]) -> None:
        """Enter a frame whose files are complete."""
        for name in frame_files(labels):
            append_line(self._folder / CHECKSUMS, f"{sha256(self._folder / name)}  {name}")
        text = json.dumps(labels, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        append_line(shard_path(self._folder, labels["index"]), text)

    def recover(self) -> set[int]:
        """Find the frames that are done; drop torn lines, and frames whose files are not as entered.

        Returns:
            Indices of frames that are complete.
        """
        path = self._folder / CHECKSUMS
        digests: dict[str, str] = {}
        for row in whole_lines(path):
            digest, _, name = row.decode(errors="replace").rstrip("\n").partition("  ")
            digests[name] = digest
        done: set[int] = set()
        kept: set[str] = set()
        # Reading and hashing leave Python to the other threads.
        with ThreadPoolExecutor() as threads:
            for intact in threads.map(partial(self._mend, digests), range(len(self._shards))):
                for index, names in intact.items():
                    done.add(index)
                    kept.update(names)
        text = "".join(f"{digest}  {name}\n" for name, digest in digests.items() if name in kept)
        if path.exists() and path.read_bytes() != text.encode():
            write_bytes(path, text.encode())
        return done

    def _mend(self, digests: Mapping[str, str], shard: int) -> dict[int, list[str]]:
        """Drop what is not whole from a shard; files of the frames that are left, by index."""
        path = self._shards[shard]
        intact: dict[int, list[str]] = {}
        lines: list[bytes] = []
        for line in whole_lines(path):
            labels = _labels(line)
            if labels is None or labels["index"] in intact:
                continue
            if labels["index"] // FRAMES_PER_SHARD != shard:
                continue
            names = frame_files(labels)
            if all(self._is_intact(name, digests) for name in names):
                intact[labels["index"]] = names
                lines.append(line)
        if path.exists() and sum(map(len, lines)) != path.stat().st_size:
            write_bytes(path, b"".join(lines))
        return intact

    def _is_intact(self, name: str, digests: Mapping[str, str]) -> bool:
        try:
            return name in digests and sha256(f"{self._folder}/{name}") == digests[name]
        except OSError:
            return False

    def put_in_order(self) -> None:
        """Sort the lines by frame where workers were done out of turn, and the checksums likewise."""
        for path in self._shards:
            _sort(path, lambda line: json.loads(line)["index"])
        _sort(self._folder / CHECKSUMS, _place_of_row)


def _sort(path: Path, key: Callable[[bytes], Any]) -> None:
    lines = list(whole_lines(path))
    ordered = sorted(lines, key=key)
    if ordered != lines:
        write_bytes(path, b"".join(ordered))


def _place_of_row(row: bytes) -> tuple[int, bytes]:
    """``digest  images/000012.png`` → (12, b"images")."""
    folder, _, name = row.split(b"  ", 1)[1].rpartition(b"/")
    return int(name.split(b".")[0]), folder


def _labels(line: bytes) -> dict[str, Any] | None:
    try:
        labels = json.loads(line.decode())
    except ValueError:
        return None
    return labels if isinstance(labels, dict) and isinstance(labels.get("index"), int) else None
