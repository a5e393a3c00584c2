"""Messages between POSSE and its worker: a JSON header and raw arrays over a byte stream.

    magic and version   8 bytes, b"POSSEBL" and the version
    header length       4 bytes, unsigned, little-endian
    header              UTF-8 JSON: kind (text), values (an object), arrays ([[name, dtype, shape], ...])
    arrays              the bytes of each array in turn, C order, little-endian

Nothing in a message is ever executed, and the size of an array is known before it is read. Both ends
import this module, under interpreters that may differ in version. It therefore needs only numpy 1.26 or
later and imports nothing of POSSE.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

PROTOCOL = 3
"""Version of the messages, which must be the same at both ends."""

MAGIC = b"POSSEBL" + bytes([PROTOCOL])
DTYPES = ("<f4", "<f8", "<i4", "|u1")
MAX_HEADER_BYTES = 16 * 2**20
MAX_ARRAY_BYTES = 4 * 2**30


class WireError(Exception):
    """The received bytes are not a message of this protocol."""


class WireClosed(WireError):
    """The stream ended: the other end is gone."""


class Source(Protocol):
    """A stream to read messages from; ``readinto`` is that of a raw file and returns 0 at the end."""

    def readinto(self, buffer: memoryview, /) -> int | None:
        """Fill part of the buffer and return the number of bytes."""


class Sink(Protocol):
    """A stream to write messages to; ``write`` is that of a raw file and may accept only part of the
    data."""

    def write(self, data: memoryview, /) -> int | None:
        """Accept part of the data and return the number of bytes."""


@dataclass(frozen=True)
class Message:
    """One message: a kind, JSON values and named arrays (float32, float64, int32 or uint8)."""

    kind: str
    values: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, np.ndarray[Any, Any]] = field(default_factory=dict)


def send(sink: Sink, message: Message) -> None:
    """Write one message.

    Raises:
        WireError: the message has an array of another type.
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
        WireError: the bytes are not a message, or one of another version.
    """
    start = _read(source, len(MAGIC) + 4)
    if start[:-4] != MAGIC:
        raise WireError(f"expected {MAGIC!r} and got {bytes(start[:-4])!r}")
    (length,) = struct.unpack("<I", start[-4:])
    if length > MAX_HEADER_BYTES:
        raise WireError(f"a header of {length} bytes is too long")
    try:
        header = json.loads(bytes(_read(source, length)))
        kind, values, listed = header["kind"], header["values"], header["arrays"]
        shapes = {str(name): (str(dtype), tuple(int(n) for n in shape)) for name, dtype, shape in listed}
    except (ValueError, KeyError, TypeError) as error:
        raise WireError(f"the header cannot be read: {type(error).__name__}: {error}") from None
    return Message(kind, values, {name: _array(source, *shapes[name]) for name in shapes})


def _array(source: Source, dtype: str, shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
    if dtype not in DTYPES or min(shape, default=0) < 0:
        raise WireError(f"an array of type {dtype} and shape {shape} is not allowed")
    size = np.dtype(dtype).itemsize
    for n in shape:
        size *= n
    if size > MAX_ARRAY_BYTES:
        raise WireError(f"an array of {size} bytes is too large")
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
