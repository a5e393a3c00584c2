"""Writing images to the paths that a format prescribes, by hard links where possible."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._files.atomic import write_bytes


def link_or_copy(source: Path, target: Path) -> None:
    """Make ``target`` a hard link to ``source``, or a copy if links are not possible."""
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
    """Write an image as PNG atomically: (H, W), or (H, W, 3) red-green-blue; uint8 or uint16."""
    _, data = cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])
    write_bytes(path, data.tobytes())


def eight_bit(image: AnyArray) -> AnyArray:
    """An image of 8 or 16 bits → the same of 8 bits."""
    if image.dtype == np.uint8:
        return image
    return np.rint(image / 257.0).astype(np.uint8)
