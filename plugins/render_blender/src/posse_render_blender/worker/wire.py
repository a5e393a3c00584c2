"""Messages between POSSE and its worker: a JSON header and raw arrays, over a byte stream.

    magic and version   8 bytes, b"POSSEBL" and the version
    header length       4 bytes, unsigned, little-endian
    header              UTF-8 JSON: kind (text), values (an object), arrays ([[name, dtype, shape], ...])
    arrays              their bytes one after the other, C order, little-endian

Nothing in a message is ever executed, and an array's size is known before it is read. This module is
imported at both ends, by two interpreters that may differ in version: it needs numpy 1.26 or later,
and nothing of POSSE.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

PROTOCOL = 2
"""Version of the messages; both ends must have the same."""

MAGIC = b"POSSEBL" + bytes([PROTOCOL])
DTYPES = ("<f4", "<f8", "<i4", "|u1")
MAX_HEADER_BYTES = 16 * 2**20
MAX_ARRAY_BYTES = 4 * 2**30


class WireError(Exception):
    """What came is not a message of this protocol."""


class WireClosed(WireError):
    """The stream ended: the other end is gone."""


class Source(Protocol):
    """Where messages come from: ``readinto`` as of a raw file, 0 at the end."""

    def readinto(self, buffer: memoryview, /) -> int | None:
        """Fill a part of the buffer and return its length."""


class Sink(Protocol):
    """Where messages go: ``write`` as of a raw file, which may take a part."""

    def write(self, data: memoryview, /) -> int | None:
        """Take a part of the data and return its length."""


@dataclass(frozen=True)
class Message:
    """One message: a kind, JSON values and named arrays (float32, float64, int32 or uint8)."""

    kind: str
    values: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, np.ndarray[Any, Any]] = field(default_factory=dict)


def send(sink: Sink, message: Message) -> None:
    """Write one message.

    Raises:
        WireError: it holds an array of another type.
        BrokenPipeError: the other end is gone.
    """
    arrays = {}
    for name, array in message.arrays.items():
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        if little.dtype.str not in DTYPES:
            raise WireError(f"array {name!r} is of type {array.dtype}")
        arrays[name] = little.reshape(array.shape)  # ascontiguousarray makes 0-d arrays 1-d
    header = json.dumps(
        {
            "kind": message.kind,
            "values": dict(message.values),
            "arrays": [[name, array.dtype.str, array.shape] for name, array in arrays.items()],
        }
    ).encode()
    _write(sink, MAGIC + struct.pack("<I", len(header)) + header)
    for array in arrays.values():
        if array.size:
            _write(sink, array.reshape(-1).view(np.uint8).data)


def receive(source: Source) -> Message:
    """Read one message.

    Raises:
        WireClosed: the stream ended.
        WireError: what came is no message, or one of another version.
    """
    start = _read(source, len(MAGIC) + 4)
    if start[:-4] != MAGIC:
        raise WireError(f"expected {MAGIC!r} and got {bytes(start[:-4])!r}")
    (length,) = struct.unpack("<I", start[-4:])
    if length > MAX_HEADER_BYTES:
        raise WireError(f"a header of {length} bytes")
    try:
        header = json.loads(bytes(_read(source, length)))
        kind, values, listed = header["kind"], header["values"], header["arrays"]
        shapes = {str(name): (str(dtype), tuple(int(n) for n in shape)) for name, dtype, shape in listed}
    except (ValueError, KeyError, TypeError) as error:
        raise WireError(f"a header that is none: {type(error).__name__}: {error}") from None
    return Message(kind, values, {name: _array(source, *shapes[name]) for name in shapes})


def _array(source: Source, dtype: str, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    if dtype not in DTYPES or min(shape, default=0) < 0:
        raise WireError(f"an array of type {dtype} and shape {shape}")
    size = np.dtype(dtype).itemsize
    for n in shape:
        size *= n
    if size > MAX_ARRAY_BYTES:
        raise WireError(f"an array of {size} bytes")
    return np.ndarray(shape, dtype, buffer=_read(source, size))


def _read(source: Source, size: int) -> bytearray:
    data = bytearray(size)
    view = memoryview(data)
    while view:
        count = source.readinto(view)
        if not count:
            raise WireClosed(f"the stream ended with {len(view)} bytes missing")
        view = view[count:]
    return data


def _write(sink: Sink, data: bytes | memoryview) -> None:
    view = memoryview(data)
    while view:
        view = view[sink.write(view) :]
