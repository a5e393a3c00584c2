"""The labels on disk: append-only shards of JSON lines, and the checksums of the frames' files.

A frame is done when its line stands whole in a shard. Its files and their checksums are written
before that, so a run that is cut at any point leaves at most one torn line, which is dropped.
Lines hold labels alone, and are written in the order of frames: so they are the same to the bit
whichever renderer made the pictures, and with any number of workers.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
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

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        (folder / "labels").mkdir(exist_ok=True)

    def append(self, labels: Mapping[str, Any]) -> None:
        """Enter a frame whose files are complete."""
        for name in frame_files(labels):
            append_line(self._folder / CHECKSUMS, f"{sha256(self._folder / name)}  {name}")
        text = json.dumps(labels, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        append_line(shard_path(self._folder, labels["index"]), text)

    def recover(self, frames: int) -> set[int]:
        """Find the frames that are done; drop torn lines, and frames whose files are not as entered.

        Args:
            frames: number of frames in the run.

        Returns:
            Indices of frames that are complete.
        """
        checksums: dict[str, str] = {}
        for line in whole_lines(self._folder / CHECKSUMS):
            digest, _, name = line.decode().rstrip("\n").partition("  ")
            checksums[name] = digest
        done: set[int] = set()
        kept_files: list[str] = []
        for first in range(0, frames, FRAMES_PER_SHARD):
            path = shard_path(self._folder, first)
            if not path.exists():
                continue
            kept = bytearray()
            for line in whole_lines(path):
                labels = _labels(line)
                if labels is None or labels["index"] in done or not self._intact(labels, checksums):
                    continue
                done.add(labels["index"])
                kept += line
                kept_files += frame_files(labels)
            if len(kept) != path.stat().st_size:
                write_bytes(path, bytes(kept))
        text = "".join(f"{checksums[name]}  {name}\n" for name in kept_files).encode()
        path = self._folder / CHECKSUMS
        if path.exists() and path.read_bytes() != text:
            write_bytes(path, text)
        return done

    def _intact(self, labels: Mapping[str, Any], checksums: Mapping[str, str]) -> bool:
        for name in frame_files(labels):
            path = self._folder / name
            if name not in checksums or not path.is_file() or sha256(path) != checksums[name]:
                return False
        return True


def _labels(line: bytes) -> dict[str, Any] | None:
    try:
        labels = json.loads(line)
    except ValueError:
        return None
    return labels if isinstance(labels, dict) and isinstance(labels.get("index"), int) else None
