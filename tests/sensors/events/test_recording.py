"""Recordings: order, units, instants of renders, and files."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._errors import InputError
from posse_core._sensors.events.formats import written
from posse_core._sensors.events.noise import Noise
from posse_core._sensors.events.pixels import Array, Crossings
from posse_core._sensors.events.receptor import Receptor
from posse_core._sensors.events.recording import MOST_RENDERS, Events, instants_s, record


def drawn(count: int, seed: int = 0) -> Events:
    """Events in no particular order, brought into theirs."""
    random = np.random.default_rng(seed)
    made = [
        Crossings(
            random.uniform(0, 0.25, count),
            random.integers(320 * 240, size=count),
            random.random(count) < 0.5,
        )
        for _ in range(2)
    ]
    return Events.of(made, 320)


def test_events_are_in_the_order_of_their_exact_times_and_have_whole_microseconds() -> None:
    made = Crossings(
        np.array([2.5e-3, 1.0000004e-3, 1.0000003e-3]),
        np.array([7, 2, 13]),
        np.array([True, False, True]),
    )
    events = Events.of([made], 5)
    assert events.t_us.tolist() == [1000, 1000, 2500]
    assert events.x.tolist() == [3, 2, 2]
    assert events.y.tolist() == [2, 0, 1]
    assert events.p.tolist() == [1, 0, 1]


def test_a_recording_is_equal_to_the_bit_for_the_same_seed() -> None:
    def recorded(seed: int) -> Events:
        random = np.random.default_rng(seed)
        pixels = Array.drawn(
            np.random.default_rng(9),
            48,
            receptor=Receptor(1.0, 1e4, 100.0),
            threshold_on=0.2,
            threshold_off=0.2,
            threshold_sigma=0.03,
            leak_hz=0.5,
            refractory_s=1e-3,
        )
        noise = Noise.drawn(random, 2.0, 48, 0.5)
        field = np.random.default_rng(4).uniform(10, 1e4, (26, 6, 8)).astype(np.float32)
        return record(pixels, zip(np.linspace(0, 0.5, 26), field, strict=True), noise, random, 8)

    first, again, other = recorded(1), recorded(1), recorded(2)
    assert len(first.t_us) > 1000
    for name in ("x", "y", "t_us", "p"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert not np.array_equal(first.t_us, other.t_us)
    assert (np.diff(first.t_us) >= 0).all()
    assert first.t_us[-1] <= 500_000


@given(
    window_s=st.floats(1e-3, 10),
    speed_px_s=st.floats(0, 200),
    step_px=st.floats(0.1, 2),
    rate_hz=st.floats(1, 100),
)
def test_instants_keep_the_motion_between_them_small(
    window_s: float, speed_px_s: float, step_px: float, rate_hz: float
) -> None:
    if window_s * max(speed_px_s / step_px, rate_hz) > MOST_RENDERS:
        with pytest.raises(InputError, match="shorten window_s"):
            instants_s(window_s, speed_px_s, step_px, rate_hz)
        return
    instants = instants_s(window_s, speed_px_s, step_px, rate_hz)
    gaps_s = np.diff(instants)
    assert instants[0] == 0
    assert instants[-1] == window_s
    assert (gaps_s > 0).all()
    assert (gaps_s * speed_px_s <= step_px * (1 + 1e-6)).all()
    assert (gaps_s * rate_hz <= 1 + 1e-6).all()
    fewer = len(instants) - 2
    assert fewer == 0 or window_s / fewer * max(speed_px_s / step_px, rate_hz) > 1


def test_motion_without_a_bound_is_refused() -> None:
    with pytest.raises(InputError, match="inf px/s"):
        instants_s(1.0, np.inf, 0.5, 30.0)


@pytest.mark.parametrize("count", [0, 5000])
def test_hdf5_has_the_layout_of_dsec(count: int) -> None:
    """https://dsec.ifi.uzh.ch/data-format: for each millisecond, t[ms_to_idx] is at or after it and the
    event before is earlier."""
    h5py = pytest.importorskip("h5py")
    events = drawn(count)
    content = written("h5", events, 12_000_000, 250_000, (320, 240))
    assert content == written("h5", events, 12_000_000, 250_000, (320, 240))
    with h5py.File(io.BytesIO(content)) as file:
        assert set(file) == {"events", "ms_to_idx", "t_offset"}
        t = file["events/t"][:]
        assert {name: array.dtype.name for name, array in file["events"].items()} == {
            "x": "uint16",
            "y": "uint16",
            "t": "uint32",
            "p": "uint8",
        }
        for name in ("x", "y", "p"):
            np.testing.assert_array_equal(file[f"events/{name}"][:], getattr(events, name))
        np.testing.assert_array_equal(t, events.t_us)
        assert file["t_offset"][()] == 12_000_000
        index = file["ms_to_idx"][:].astype(int)
    assert len(index) > 250
    for millisecond, first in enumerate(index):
        assert (t[:first] < millisecond * 1000).all()
        assert (t[first:] >= millisecond * 1000).all()


@pytest.mark.parametrize("count", [0, 5000])
def test_aedat4_is_read_by_another_library(count: int, tmp_path: Path) -> None:
    pytest.importorskip("dv_processing")
    aedat = pytest.importorskip("aedat")
    events = drawn(count)
    content = written("aedat4", events, 12_000_000, 250_000, (320, 240))
    assert content == written("aedat4", events, 12_000_000, 250_000, (320, 240))
    path = tmp_path / "events.aedat4"
    path.write_bytes(content)
    decoder = aedat.Decoder(path)
    assert decoder.id_to_stream() == {0: {"type": "events", "width": 320, "height": 240}}
    packets = [packet["events"] for packet in decoder]
    if count == 0:
        assert sum(map(len, packets)) == 0
        return
    read = np.concatenate(packets)
    np.testing.assert_array_equal(read["t"], events.t_us + 12_000_000)
    for ours, theirs in (("x", "x"), ("y", "y"), ("p", "on")):
        np.testing.assert_array_equal(read[theirs], getattr(events, ours))
