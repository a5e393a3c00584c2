"""Decoding images that may be damaged."""

from __future__ import annotations

import contextlib
import os
import threading
import zlib
from collections.abc import Iterator
from typing import Final

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._files.picture_size import claimed_size_px
from posse_core._model.camera import MOST_SIDE_PX

_PNG: Final = b"\x89PNG\r\n\x1a\n"
_ONE_AT_A_TIME: Final = threading.Lock()


def decoded_image(data: bytes, flags: int) -> AnyArray | None:
    """Decode an image file, PNG, JPEG, WebP, TIFF or BMP.

    Args:
        data: the file.
        flags: of OpenCV, such as ``cv2.IMREAD_COLOR``.

    Returns:
        The image as OpenCV gives it, blue first, or None if the data cannot be decoded.
    """
    if data.startswith(_PNG):
        return _decoded(data, flags) if _is_whole_png(data) else None  # libpng would print its own lines
    if not all(0 < side_px <= MOST_SIDE_PX for side_px in claimed_size_px(data)):
        return None
    with _silence():
        return _decoded(data, flags)


def _decoded(data: bytes, flags: int) -> AnyArray | None:
    try:
        return cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:  # no bytes, or more pixels than are decoded
        return None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep the decoders from printing: what is wrong with a picture is told in POSSE's own words.

    OpenCV's messages have a level. libjpeg prints on the process's stderr, and nothing turns this off.
    """
    with _ONE_AT_A_TIME, open(os.devnull, "wb") as nowhere:
        level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        stderr = os.dup(2)
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            cv2.utils.logging.setLogLevel(level)


def _is_whole_png(data: bytes) -> bool:
    """Whether a PNG file's size is plausible, and its chunks are complete and as their checksums say."""
    width_px, height_px = int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    if max(width_px, height_px) > MOST_SIDE_PX:
        return False
    at = len(_PNG)
    while at + 12 <= len(data):
        after = at + 8 + int.from_bytes(data[at : at + 4])
        kind = data[at + 4 : at + 8]
        if int.from_bytes(data[after : after + 4]) != zlib.crc32(data[at + 4 : after]):
            return False
        if kind == b"IEND":
            return True
        at = after + 4
    return False
