"""The size that a picture's header claims, read before a decoder makes room for so many pixels."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final

_SIZES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG's markers of a frame's header."""
_ALONE: Final = {0x01, *range(0xD0, 0xD9)}
"""JPEG's markers without a length."""
_WIDTH, _HEIGHT = 256, 257
"""TIFF's tags."""
_WORD: Final = {3: "H", 4: "I", 16: "Q"}
"""TIFF's types of whole numbers."""


def claimed_size_px(data: bytes) -> tuple[int, int]:
    """The greatest width and height that the header of a JPEG, TIFF, BMP or WebP file claims.

    They are 0 where it claims none, or the file is of another format. Sources: ITU-T T.81; TIFF
    6.0 and BigTIFF; the BITMAPINFOHEADER of Windows; RFC 9649 (WebP).
    """
    try:
        if data[:2] == b"\xff\xd8":
            found = list(_jpeg(data))
        elif data[:2] in (b"II", b"MM"):
            found = list(_tiff(data, "<" if data[:2] == b"II" else ">"))
        elif data[:2] == b"BM":
            found = [_bmp(data)]
        elif data[:4] == b"RIFF" and data[8:12] == b"WEBP":
            found = list(_webp(data))
        else:
            found = []
    except (struct.error, IndexError):  # it ends within its header
        found = []
    return max((w for w, _ in found), default=0), max((h for _, h in found), default=0)


def _jpeg(data: bytes) -> Iterator[tuple[int, int]]:
    at = 2
    while at + 4 <= len(data):
        marker = data[at + 1]
        if data[at] != 0xFF or marker in (0xFF, *_ALONE):
            at += 2 if data[at] == 0xFF and marker in _ALONE else 1
            continue
        if marker in _SIZES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            yield width, height
        at += 2 + int.from_bytes(data[at + 2 : at + 4])


def _tiff(data: bytes, order: str) -> Iterator[tuple[int, int]]:
    """The size of every directory; a loop of directories ends."""
    is_big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
    offset, count, entry = ("Q", "Q", 20) if is_big else ("I", "H", 12)
    (at,) = struct.unpack_from(order + offset, data, 8 if is_big else 4)
    seen: set[int] = set()
    while at and at not in seen:
        seen.add(at)
        (entries,) = struct.unpack_from(order + count, data, at)
        at += struct.calcsize(count)
        size = {_WIDTH: 0, _HEIGHT: 0}
        for first in range(at, min(at + entries * entry, len(data)), entry):
            tag, kind = struct.unpack_from(f"{order}HH", data, first)
            if tag in size and kind in _WORD:
                value = first + entry - struct.calcsize(offset)
                (size[tag],) = struct.unpack_from(order + _WORD[kind], data, value)
        yield size[_WIDTH], size[_HEIGHT]
        at += entries * entry
        if at + struct.calcsize(offset) > len(data):
            return
        (at,) = struct.unpack_from(order + offset, data, at)


def _bmp(data: bytes) -> tuple[int, int]:
    if data[14:18] == b"\x0c\0\0\0":
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)


def _webp(data: bytes) -> Iterator[tuple[int, int]]:
    at = 12
    while at + 8 <= len(data):
        kind, length = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        body = data[at + 8 : at + 18]
        if kind == b"VP8X":
            yield 1 + int.from_bytes(body[4:7], "little"), 1 + int.from_bytes(body[7:10], "little")
        elif kind == b"VP8L":
            bits = int.from_bytes(body[1:5], "little")
            yield 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
        elif kind == b"VP8 ":
            width, height = struct.unpack_from("<HH", body, 6)
            yield width & 0x3FFF, height & 0x3FFF
        at += 8 + length + length % 2
