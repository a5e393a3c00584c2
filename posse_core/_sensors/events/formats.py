"""Events in the file formats that event cameras' tools read: HDF5 as in DSEC, and AEDAT4."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from posse_core._errors import ComponentError
from posse_core._sensors.events.recording import Events

Format: TypeAlias = Literal["h5", "aedat4"]
"""Ending of a file of events."""
_NEEDED: Final[Mapping[Format, str]] = {"h5": "h5py", "aedat4": "dv_processing"}
"""Format → the module that writes it; the extra ``events`` installs all."""
_US_PER_MS = 1000
_LEVEL = 1


def check(chosen: Format) -> None:
    """Raise a ComponentError if the library that writes a format is missing."""
    module = _NEEDED[chosen]
    try:
        __import__(module)
    except ImportError:
        raise ComponentError(
            f"events: the format {chosen!r} needs {module}; pip install posse-core[events]"
        ) from None


def written(
    chosen: Format, events: Events, offset_us: int, window_us: int, size_px: tuple[int, int]
) -> bytes:
    """The content of a file of events.

    Args:
        offset_us: microseconds from the scenario's epoch to the recording's instant.
        window_us: length of the recording, microseconds.
        size_px: width and height of the image.
    """
    return _WRITERS[chosen](events, offset_us, window_us, size_px)


def _h5(events: Events, offset_us: int, window_us: int, size_px: tuple[int, int]) -> bytes:
    """HDF5 in the layout of DSEC (Gehrig, Aarents, Gehrig, Scaramuzza 2021): ``events/x``, ``y``, ``t``,
    ``p``, ``t_offset``, which is added to t, and ``ms_to_idx``, the index of the first event at or after
    each millisecond."""
    import h5py

    milliseconds = np.arange(window_us // _US_PER_MS + 2) * _US_PER_MS
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, array, dtype in (
            ("x", events.x, np.uint16),
            ("y", events.y, np.uint16),
            ("t", events.t_us, np.uint32),
            ("p", events.p, np.uint8),
        ):
            file.create_dataset(
                f"events/{name}",
                data=array.astype(dtype),
                maxshape=(None,),  # otherwise HDF5 does not compress an array without events
                compression="gzip",
                compression_opts=_LEVEL,
                shuffle=True,
            )
        file["ms_to_idx"] = np.searchsorted(events.t_us, milliseconds).astype(np.uint64)
        file["t_offset"] = np.int64(offset_us)
    return content.getvalue()


def _aedat4(events: Events, offset_us: int, window_us: int, size_px: tuple[int, int]) -> bytes:
    """AEDAT4 with one stream of events, whose times count from the scenario's epoch."""
    import dv_processing as dv

    store = dv.EventStore()
    columns = (events.t_us + offset_us, events.x, events.y, events.p.astype(np.bool_))
    for t_us, x, y, p in zip(*(column.tolist() for column in columns), strict=True):
        store.push_back(t_us, x, y, p)
    with tempfile.TemporaryDirectory() as folder:  # the library writes to a path only
        path = Path(folder) / "events.aedat4"
        config = dv.io.MonoCameraWriter.EventOnlyConfig("posse", size_px)
        writer = dv.io.MonoCameraWriter(str(path), config)
        writer.writeEvents(store)
        del writer  # it ends the file when it is freed
        return path.read_bytes()


_WRITERS: Final[Mapping[Format, Callable[[Events, int, int, tuple[int, int]], bytes]]] = {
    "h5": _h5,
    "aedat4": _aedat4,
}
