"""Images placed where a format wants them, without taking the disk a second time where that can be."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import cv2

from posse_core._arrays import AnyArray
from posse_core._files.atomic import write_bytes


def place(source: Path, target: Path) -> None:
    """Make ``target`` the same file as ``source``: a hard link, or a copy where there are none."""
    if target.exists() and target.samefile(source):
        return
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:  # another disk, or a file system without links
        temporary = target.with_name(f".{target.name}")
        shutil.copyfile(source, temporary)
        os.replace(temporary, target)


def write_png(path: Path, image: AnyArray) -> None:
    """Write (H, W) uint8 or uint16 as PNG, atomically."""
    _, data = cv2.imencode(".png", image)
    write_bytes(path, data.tobytes())
