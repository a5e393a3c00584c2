"""Messages arrive as they were sent, and everything else is refused."""

from __future__ import annotations

import io
import os
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from posse_render_blender.worker.wire import (
    DTYPES,
    MAGIC,
    MAX_HEADER_BYTES,
    Message,
    WireClosed,
    WireError,
    receive,
    send,
)

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
ARRAYS = st.sampled_from(DTYPES).flatmap(
    lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
)
MESSAGES = st.builds(
    Message,
    kind=st.text(),
    values=st.dictionaries(st.text(), JSON, max_size=4),
    arrays=st.dictionaries(st.text(), ARRAYS, max_size=4),
)


class Trickle(io.RawIOBase):
    """A stream that reads and writes at most three bytes at a time, as a pipe may."""

    def __init__(self, data: bytes = b"") -> None:
        self.data = bytearray(data)

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        part = self.data[: min(3, len(buffer))]
        buffer[: len(part)] = part
        del self.data[: len(part)]
        return len(part)

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        self.data += bytes(data[:3])
        return min(3, len(data))


def assert_same(got: Message, sent: Message) -> None:
    assert (got.kind, got.values) == (sent.kind, sent.values)
    assert list(got.arrays) == list(sent.arrays)
    for name, array in sent.arrays.items():
        assert got.arrays[name].dtype == array.dtype
        assert got.arrays[name].shape == array.shape
        assert got.arrays[name].tobytes() == array.tobytes()
        assert got.arrays[name].flags.writeable


@given(st.lists(MESSAGES, max_size=3))
def test_messages_arrive_as_they_were_sent(messages: list[Message]) -> None:
    stream = Trickle()
    for message in messages:
        send(stream, message)
    for message in messages:
        assert_same(receive(stream), message)
    with pytest.raises(WireClosed):
        receive(stream)


@given(MESSAGES, st.data())
def test_a_stream_that_ends_within_a_message_is_closed(message: Message, data: st.DataObject) -> None:
    stream = Trickle()
    send(stream, message)
    cut = data.draw(st.integers(0, len(stream.data) - 1))
    with pytest.raises(WireClosed):
        receive(Trickle(bytes(stream.data[:cut])))


@given(st.binary(min_size=12, max_size=64).filter(lambda data: not data.startswith(MAGIC)))
def test_random_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(WireError, match="expected"):
        receive(Trickle(data))


def test_another_version_is_refused() -> None:
    stream = Trickle()
    send(stream, Message("hello"))
    stream.data[len(MAGIC) - 1] += 1
    with pytest.raises(WireError, match="expected"):
        receive(stream)


@pytest.mark.parametrize(
    "header",
    [
        b"{",
        b"[]",
        b'{"kind": "x", "values": {}}',
        b'{"kind": "x", "values": {}, "arrays": [["a", "|O", [1]]]}',
        b'{"kind": "x", "values": {}, "arrays": [["a", "<f4", [-1]]]}',
        b'{"kind": "x", "values": {}, "arrays": [["a", "<f4", [1000000, 1000000]]]}',
        b'{"kind": "x", "values": {}, "arrays": [["a", "<f4"]]}',
    ],
)
def test_a_bad_header_is_refused_before_anything_is_allocated(header: bytes) -> None:
    with pytest.raises(WireError):
        receive(Trickle(MAGIC + len(header).to_bytes(4, "little") + header))


def test_a_header_that_is_too_long_is_refused() -> None:
    with pytest.raises(WireError, match="header of"):
        receive(Trickle(MAGIC + (MAX_HEADER_BYTES + 1).to_bytes(4, "little")))


def test_arrays_of_other_types_are_not_sent() -> None:
    for array in (np.array(["text"]), np.array([1], dtype=np.int64), np.array([{}], dtype=object)):
        with pytest.raises(WireError, match="is of type"):
            send(Trickle(), Message("x", {}, {"a": array}))


def test_strides_and_byte_order_do_not_matter() -> None:
    array = np.arange(24, dtype=">f4").reshape(4, 6)[::-1, ::2]
    stream = Trickle()
    send(stream, Message("x", {}, {"a": array}))
    np.testing.assert_array_equal(receive(stream).arrays["a"], array)


def test_a_message_larger_than_the_pipes_buffer() -> None:
    out, into = os.pipe()
    message = Message("image", {}, {"a": np.arange(10**6, dtype=np.float32).reshape(1000, 1000)})
    with open(out, "rb", buffering=0) as source, open(into, "wb", buffering=0) as sink:
        writer = threading.Thread(target=send, args=(sink, message))
        writer.start()
        assert_same(receive(source), message)
        writer.join()
