"""Readings of sensors, made small enough to be carried in the page.

How a reading is shown follows from what it holds, not from its sensor: ``docs/view.md`` says which
arrays are points, events and maps.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray, evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.readings import read_reading
from posse_core._model.camera import Camera
from posse_core._model.reading import Reading
from posse_core._view.coding import coded_image, coded_map, text

MOST_READINGS = 24
"""Readings of a sensor that a frame of the page carries at most, evenly spread."""
MOST_POINTS = 4096
MOST_EVENTS = 8192
"""Of a reading, evenly spread."""
TEMPERATURES = ("temperature_k", "brightness_temperature_k")
"""Arrays (H, W) that are maps even where a sensor has neither a camera nor an image."""
_EVENTS = ("x", "y", "t_us", "p")


def reading_previews(dataset: Dataset, i: int) -> dict[str, list[dict[str, Any] | None]]:
    """Sensor → what the page shows of its readings at position ``i``; None for those left out.

    Raises:
        InputError: a file of a reading is missing or damaged.
    """
    labels = dataset[i]
    shown: dict[str, list[dict[str, Any] | None]] = {}
    for name, readings in labels.sensors.items() if labels.has("sensors") else ():
        chosen = set(evenly_spread(len(readings), MOST_READINGS).tolist())
        camera = dataset.sensors[name].camera if name in dataset.sensors else None
        shown[name] = [
            reading_preview(read_reading(dataset.folder, reading), camera) if k in chosen else None
            for k, reading in enumerate(readings)
        ]
    return shown


def reading_preview(reading: Reading, camera: Camera | None) -> dict[str, Any]:
    """What the page shows of a reading beside its labels.

    ``arrays``: [name, type, shape] of each; ``files``: ending → bytes; ``size_px``: [width, height] of
    the image, maps and events, or None; ``image``: JPEG, base64; ``maps``: name → :func:`coded_map`;
    ``points`` and ``events``: binary columns, base64, of those chosen, or None.

    Args:
        camera: of the sensor, or None.
    """
    arrays = reading.arrays
    events = _events(arrays)
    shape = _shape(reading, camera, events)
    maps = {
        name: coded_map(np.asarray(array, dtype=np.float64))
        for name, array in arrays.items()
        if _is_map(name, array, shape)
    }
    return {
        "arrays": [[name, str(array.dtype), list(array.shape)] for name, array in arrays.items()],
        "files": {ending: len(content) for ending, content in reading.files.items()},
        "size_px": None if shape is None else [shape[1], shape[0]],
        "image": None if reading.image is None else coded_image(reading.image),
        "maps": {name: coded for name, coded in maps.items() if coded is not None},
        "points": _coded_points(arrays),
        "events": None if events is None else _coded_events(events),
    }


def _shape(
    reading: Reading, camera: Camera | None, events: Mapping[str, AnyArray] | None
) -> tuple[int, int] | None:
    """Rows and columns of the sensor's pixels, from the first of its properties that tells them."""
    if camera is not None:
        return camera.height_px, camera.width_px
    if reading.image is not None:
        return reading.image.shape[0], reading.image.shape[1]
    for name in TEMPERATURES:
        if name in reading.arrays and reading.arrays[name].ndim == 2:
            return reading.arrays[name].shape[0], reading.arrays[name].shape[1]
    if events is not None and len(events["x"]):
        return int(events["y"].max()) + 1, int(events["x"].max()) + 1
    return None


def _is_map(name: str, array: AnyArray, shape: tuple[int, int] | None) -> bool:
    return array.dtype.kind == "f" and array.ndim == 2 and (array.shape == shape or name in TEMPERATURES)


def _coded_points(arrays: Mapping[str, AnyArray]) -> dict[str, Any] | None:
    """Points, metres, sensor axes: those of ``point_sensor_m`` (..., 3) that are finite.

    ``total``: how many there are; ``xyz``: float32; ``part``: int16 of ``part_id`` (...), −1 for none;
    ``intensity``: uint8, 0 … 255 for ``low`` … ``high`` of the decimal logarithm of the array ``name``
    (...), the first whose name begins so. Both are None where there is no such array.
    """
    points = arrays.get("point_sensor_m")
    if points is None or points.dtype.kind != "f" or points.ndim < 2 or points.shape[-1] != 3:
        return None
    each = {
        name: array.ravel()
        for name, array in arrays.items()
        if array.shape == points.shape[:-1] and array.dtype.kind in "iuf"
    }
    xyz_m = points.reshape(-1, 3).astype(np.float32)
    found = np.flatnonzero(np.isfinite(xyz_m).all(axis=1))
    kept = found[evenly_spread(len(found), MOST_POINTS)]
    part = each.get("part_id") if "part_id" in each and each["part_id"].dtype.kind != "f" else None
    name = next((name for name in each if name.startswith("intensity")), None)
    return {
        "total": len(found),
        "xyz": text(xyz_m[kept].astype("<f4")),
        "part": None if part is None else text(part[kept].astype("<i2")),
        "intensity": None if name is None else _coded_intensity(name, each[name][kept]),
    }


def _coded_intensity(name: str, values: AnyArray) -> dict[str, Any]:
    """Intensities differ by decades between paint and metal, so their logarithms are coloured."""
    there = np.isfinite(values) & (values > 0)
    logs = np.log10(values, where=there, out=np.zeros(len(values)))
    low, high = (float(logs[there].min()), float(logs[there].max())) if there.any() else (0.0, 0.0)
    share = np.where(there, (logs - low) / max(high - low, 1e-9), 0)
    return {
        "name": name,
        "steps": text(np.round(255 * share).astype(np.uint8)),
        "low": low,
        "high": high,
    }


def _events(arrays: Mapping[str, AnyArray]) -> dict[str, AnyArray] | None:
    """The columns of events, if the reading has all of them, of whole numbers and one length."""
    columns = {name: arrays[name] for name in _EVENTS if name in arrays}
    sizes = {array.shape for array in columns.values()}
    fit = len(columns) == len(_EVENTS) and len(sizes) == 1 and len(next(iter(sizes))) == 1
    return columns if fit and all(array.dtype.kind in "iub" for array in columns.values()) else None


def _coded_events(events: Mapping[str, AnyArray]) -> dict[str, Any]:
    """``total``; ``last_us``, the instant of the last; ``x``, ``y``: uint16; ``t_us``: float32; ``on``:
    uint8, 1 where the light rose (``p`` above 0)."""
    order = np.argsort(events["t_us"], kind="stable")
    kept = order[evenly_spread(len(order), MOST_EVENTS)]
    t_us = events["t_us"][order]
    return {
        "total": len(order),
        "last_us": float(t_us[-1]) if len(t_us) else 0.0,
        "x": text(events["x"][kept].astype("<u2")),
        "y": text(events["y"][kept].astype("<u2")),
        "t_us": text(events["t_us"][kept].astype("<f4")),
        "on": text((events["p"][kept] > 0).astype(np.uint8)),
    }
