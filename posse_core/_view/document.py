"""The HTML document that every page of the viewer is: one file, its data in script elements of JSON.

It is written frame by frame, never larger than a limit of bytes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from posse_core._arrays import IntArray, evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import MANIFEST
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine
from posse_core._view.columns import label_columns, motion_columns
from posse_core._view.html import page_halves, read, script_block
from posse_core._view.previews import preview

Progress = Callable[[Iterable[int], int], Iterable[int]]
"""Wraps the positions of the frames to show progress: (positions, how many)."""
LEFT_OUT = ("part_area_px",)
"""Labels that a page does not carry: long, and nothing is drawn from them."""
VIEWER_SCRIPTS = (
    "numbers.js",
    "data.js",
    "canvas.js",
    "picture.js",
    "showings.js",
    "turntable.js",
    "cloud.js",
    "eventimage.js",
    "sensors.js",
)
"""Scripts of the frame and of the readings beside it; ``player.js`` follows them."""
_SAMPLES = 12
"""Frames whose previews are made beforehand to see how large they become."""


@dataclass(frozen=True)
class Page:
    """What was written: frames shown, frames whose preview is in the page, bytes."""

    frames: int
    previews: int
    size_bytes: int


@dataclass(frozen=True)
class Document:
    """A page before it is written.

    Attributes:
        dataset: whose frames it shows.
        positions: of these frames.
        body, styles, scripts: files of this package. In the body, ``viewer.html`` is put in for the
            comment VIEWER.
        blocks: JSON values for the scripts, by the id of their element.
        of_frame: JSON value that a frame's block has beside labels and preview, by the frame's index.
    """

    dataset: Dataset
    positions: Sequence[int]
    body: str
    styles: Sequence[str]
    scripts: Sequence[str]
    blocks: dict[str, Any]
    of_frame: Callable[[int], dict[str, Any]]

    def write(self, out: Path, *, max_bytes: int, way_out: str, progress: Progress) -> Page:
        """Write the page to ``out``, never larger than ``max_bytes``.

        All frames have previews or, where they would not fit, evenly spread ones have.

        Raises:
            InputError: the page is larger without any preview; ``way_out`` ends the message.
        """
        dataset, positions = self.dataset, self.positions
        bare = [len(self._frame(dataset[position], None)) for position in positions]
        head, tail = self._halves(out)
        room = max_bytes - len(head) - len(tail) - sum(bare)
        if room < 0:
            raise InputError(
                f"{dataset.folder}: a page of {len(positions)} frames takes"
                f" {(max_bytes - room) / 2**20:.1f} MiB without previews, over {max_bytes / 2**20:g};"
                f" {way_out}"
            )
        chosen = self._previewed(room)
        previews, size = 0, len(head) + len(tail)
        with atomic_file(out) as stream:
            stream.write(head)
            for position, least in zip(progress(positions, len(positions)), bare, strict=True):
                labels = dataset[position]
                block = self._frame(labels, preview(dataset, position) if position in chosen else None)
                if len(block) - least > room:
                    block = self._frame(labels, None)
                previews += len(block) > least
                room -= len(block) - least
                size += len(block)
                stream.write(block)
            stream.write(tail)
        return Page(len(positions), previews, size)

    def _previewed(self, room: int) -> set[int]:
        """Positions of as many evenly spread frames as have room for previews, by the mean of a few."""
        positions = self.positions
        sample = [positions[i] for i in evenly_spread(len(positions), _SAMPLES)]
        mean = np.mean([len(json.dumps(preview(self.dataset, position))) for position in sample])
        return {positions[i] for i in evenly_spread(len(positions), int(room / mean))}

    def _frame(self, labels: LabelLine, small: dict[str, Any] | None) -> bytes:
        value = {"labels": _kept(labels.as_json()), "preview": small, **self.of_frame(labels.index)}
        return script_block(f"frame-{labels.index}", value)

    def _halves(self, out: Path) -> tuple[bytes, bytes]:
        """The page before its frames, and after them."""
        blocks = {"dataset": _dataset_block(self.dataset, out, self.positions), **self.blocks}
        body = read(self.body).replace("<!--VIEWER-->\n", read("viewer.html"))
        return page_halves(body, self.styles, self.scripts, blocks)


def _dataset_block(dataset: Dataset, out: Path, positions: Sequence[int]) -> dict[str, Any]:
    index: IntArray = dataset.indices[list(positions)]
    trajectory = dataset.trajectory
    ended = (dataset.folder / MANIFEST).exists()
    relative = Path(os.path.relpath(dataset.folder.resolve(), out.resolve().parent)).as_posix()
    return {
        "name": dataset.folder.resolve().name,
        "folder": quote(relative) + "/",
        "epoch_utc": trajectory.epoch_utc,
        "frames": len(dataset),
        "camera": _camera(dataset.camera),
        "sensors": {
            name: {
                "type": sensor.type,
                "rate_hz": sensor.rate_hz,
                "camera": None if sensor.camera is None else _camera(sensor.camera),
            }
            for name, sensor in dataset.sensors.items()
        },
        "spacecraft": {
            name: _spacecraft(info, dataset.mesh(name))
            for name, info in dataset.spacecraft_by_name.items()
        },
        "bodies": {
            name: _spacecraft(info, dataset.body_mesh(name)) for name, info in dataset.bodies.items()
        },
        "columns": {
            **label_columns(dataset[position] for position in positions),
            **motion_columns(trajectory, index),
        },
        "manifest": dataset.manifest.as_json() if ended else None,
    }


def _kept(labels: dict[str, Any]) -> dict[str, Any]:
    """The labels that a page carries, of a frame and of its sensors' readings."""

    def short(all_of_it: dict[str, Any]) -> dict[str, Any]:
        kept = {name: value for name, value in all_of_it.items() if name not in LEFT_OUT}
        if isinstance(kept.get("bodies"), dict):
            kept["bodies"] = {
                name: short(body) if isinstance(body, dict) else body
                for name, body in kept["bodies"].items()
            }
        return kept

    sensors = {
        name: [{**reading, "labels": short(reading["labels"])} for reading in readings]
        for name, readings in labels.get("sensors", {}).items()
    }
    return short({**labels, "sensors": sensors} if sensors else labels)


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "matrix": camera.matrix.tolist(),
        "model": None if camera.distortion is None else camera.distortion.model,
        "distortion": camera.distortion_coefficients.tolist(),
        "reach": None if camera.distortion is None else camera.distortion.reach,
    }


def _spacecraft(info: SpacecraftInfo, mesh: Mesh) -> dict[str, Any]:
    """Lines to draw between keypoints, the names of the parts, the kinds of the joints by name, and the
    longest side and the middle of the mesh's box, body axes, metres."""
    low, high = mesh.vertices_body_m.min(axis=0), mesh.vertices_body_m.max(axis=0)
    return {
        "skeleton": info.skeleton,
        "parts": info.parts,
        "joints": {joint.name: joint.kind for joint in info.joints},
        "size_m": float((high - low).max()),
        "middle_body_m": ((low + high) / 2).tolist(),
    }
