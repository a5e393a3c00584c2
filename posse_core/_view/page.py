"""One HTML file that shows a dataset: no server, no network, nothing beside it but the images."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from posse_core._arrays import IntArray, evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import MANIFEST
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file
from posse_core._model.label_line import LabelLine
from posse_core._view.columns import label_columns, motion_columns
from posse_core._view.previews import preview

Progress = Callable[[Iterable[int], int], Iterable[int]]
"""Wraps the positions of the frames to show progress: (positions, how many)."""
SCRIPTS = ("data.js", "picture.js", "plots.js", "orbit.js", "main.js")
LEFT_OUT = ("part_area_px",)
"""Labels that the page does not carry: long, and nothing is drawn from them."""
_SAMPLES = 12
"""Frames whose previews are made beforehand to see how large they become."""


@dataclass(frozen=True)
class Page:
    """What was written: frames shown, frames whose preview is in the page, bytes."""

    frames: int
    previews: int
    size_bytes: int


def write_page(
    dataset: Dataset, out: Path, *, frames: int | None, max_bytes: int, progress: Progress
) -> Page:
    """Write the page to ``out``, never larger than ``max_bytes``.

    Every frame's labels are in it. Previews are too, for all frames or, where they would not fit, for
    evenly spread ones; the page shows the dataset's own images where it finds them.

    Args:
        frames: show only so many, evenly spread; all if None.

    Raises:
        InputError: the labels alone are larger than that, or a file of the dataset cannot be read.
    """
    if not len(dataset):
        raise InputError(f"{dataset.folder}: has no frames to show")
    positions = evenly_spread(len(dataset), len(dataset) if frames is None else frames).tolist()
    blocks = [len(_frame_block(dataset[position], None)) for position in positions]
    head, tail = _page_halves(_dataset_block(dataset, out, positions))
    room = max_bytes - len(head) - len(tail) - sum(blocks)
    if room < 0:
        need = (max_bytes - room) / 2**20
        raise InputError(
            f"{dataset.folder}: a page of {len(positions)} frames takes {need:.1f} MiB without previews,"
            f" over {max_bytes / 2**20:g}; show fewer by --frames, or raise --max-mib"
        )
    chosen = _previewed(dataset, positions, room)
    previews, size = 0, len(head) + len(tail)
    with atomic_file(out) as stream:
        stream.write(head)
        for position, bare in zip(progress(positions, len(positions)), blocks, strict=True):
            labels = dataset[position]
            block = _frame_block(labels, preview(dataset, position) if position in chosen else None)
            if len(block) - bare > room:
                block = _frame_block(labels, None)
            previews += len(block) > bare
            room -= len(block) - bare
            size += len(block)
            stream.write(block)
        stream.write(tail)
    return Page(len(positions), previews, size)


def _previewed(dataset: Dataset, positions: list[int], room: int) -> set[int]:
    """Positions of as many evenly spread frames as have room for previews, by the mean of a few."""
    sample = [positions[i] for i in evenly_spread(len(positions), _SAMPLES)]
    mean = np.mean([len(json.dumps(preview(dataset, position))) for position in sample])
    return {positions[i] for i in evenly_spread(len(positions), int(room / mean))}


def _dataset_block(dataset: Dataset, out: Path, positions: list[int]) -> bytes:
    index: IntArray = dataset.indices[positions]
    trajectory = dataset.trajectory
    ended = (dataset.folder / MANIFEST).exists()
    relative = Path(os.path.relpath(dataset.folder.resolve(), out.resolve().parent)).as_posix()
    value = {
        "name": dataset.folder.resolve().name,
        "folder": quote(relative) + "/",
        "epoch_utc": trajectory.epoch_utc,
        "frames": len(dataset),
        "camera": {
            "width_px": dataset.camera.width_px,
            "height_px": dataset.camera.height_px,
            "matrix": dataset.camera.matrix.tolist(),
            "distortion": dataset.camera.distortion_coefficients.tolist(),
            "reach": None if dataset.camera.distortion is None else dataset.camera.distortion.reach,
        },
        "spacecraft": {name: _spacecraft(dataset, name) for name in dataset.spacecraft_by_name},
        "columns": {
            **label_columns(dataset[position] for position in positions),
            **motion_columns(trajectory, index),
        },
        "manifest": dataset.manifest.as_json() if ended else None,
    }
    return _script("dataset", value)


def _spacecraft(dataset: Dataset, name: str) -> dict[str, Any]:
    """Lines to draw between keypoints, and the longest side of the mesh's box, body axes, metres."""
    return {
        "skeleton": dataset.spacecraft_by_name[name].skeleton,
        "size_m": float(np.ptp(dataset.mesh(name).vertices_body_m, axis=0).max()),
    }


def _frame_block(labels: LabelLine, small: dict[str, Any] | None) -> bytes:
    kept = {name: value for name, value in labels.as_json().items() if name not in LEFT_OUT}
    return _script(f"frame-{labels.index}", {"labels": kept, "preview": small})


def _script(name: str, value: Any) -> bytes:
    """JSON that the page's script reads; nothing in it can end the element or begin another."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    text = text.replace("</", "\\u003c/").replace("<!", "\\u003c!")
    return f'<script type="application/json" id="{name}">{text}</script>\n'.encode()


def _page_halves(dataset_block: bytes) -> tuple[bytes, bytes]:
    """The page before its frames, and after them."""
    template = _read("page.html").replace("/*STYLE*/", _read("page.css"))
    before, after = template.split("<!--FRAMES-->\n")
    scripts = "\n".join(_scripts())
    return before.encode() + dataset_block, after.replace("/*SCRIPT*/", scripts).encode()


def _scripts() -> Iterator[str]:
    for name in SCRIPTS:
        yield _read(name)


def _read(name: str) -> str:
    return files("posse_core._view").joinpath(name).read_text(encoding="utf-8")
