"""COCO as a dataset that detectors learn from and are measured on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._dataset.dataset import (
    PARTS,
    Dataset,
    Frames,
    SpacecraftInfo,
    read_camera,
    read_json,
    read_spacecraft,
)
from posse_core._errors import InputError
from posse_core._files.atomic import sha256
from posse_core._formats.coco import coco_entries
from posse_core._model.camera import Camera


def open_dataset(path: Path) -> Dataset:
    """A dataset of ``posse run``, or COCO: a ``.json`` file, or a folder with ``train.json``.

    Raises:
        InputError: neither, or not laid as it should be.
    """
    if path.suffix == ".json" or (path / "train.json").is_file():
        return CocoDataset(path)
    return Dataset(path)


class CocoDataset(Dataset):
    """Images of one craft each, with boxes and keypoints, by COCO files.

    A folder has its parts in ``train.json``, ``valid.json`` and ``test.json``, of which the last two may
    be missing; a file is a dataset of one part, ``all``. Images are named from that folder. COCO tells
    neither the camera nor the places of keypoints on the craft: ``camera.json`` and
    ``spacecraft/NAME.json`` beside the files do, as in a dataset of ``posse run``; without the latter
    there are boxes alone.

    Frames are numbered from 0 in the order of the files.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.parent if path.suffix == ".json" else path
        named = {part: path / f"{part}.json" for part in PARTS}
        self._files = (
            {"all": path}
            if path.suffix == ".json"
            else {part: file for part, file in named.items() if file.is_file()}
        )
        self._lines: list[dict[str, Any]] = []
        self._sizes: list[tuple[int, int]] = []
        self._parts: dict[str, list[int]] = {}
        names: set[str] = set()
        for part, file in self._files.items():
            first = len(self._lines)
            names |= self._read(file)
            self._parts[part] = list(range(first, len(self._lines)))
        if not self._lines:
            raise InputError(f"{path}: has no images")
        self.spacecraft_by_name = {name: self._craft(name) for name in sorted(names)}
        for line in self._lines:
            self._order_keypoints(line)

    def _read(self, file: Path) -> set[str]:
        """Take a file's images; returns the names of its categories."""
        value = read_json(file)
        try:
            for image, labels in coco_entries(value):
                height_width = int(image["height"]), int(image["width"])
                index = len(self._lines)
                self._lines.append({**labels, "index": index, "image": str(image["file_name"])})
                self._sizes.append(height_width)
            return {str(category["name"]) for category in value["categories"]}
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{file}: not laid as COCO asks: {type(error).__name__}: {error}") from None

    def _craft(self, name: str) -> SpacecraftInfo:
        path = self.folder / "spacecraft" / f"{name}.json"
        return read_spacecraft(path) if path.is_file() else SpacecraftInfo(name, (), {}, (), ())

    def _order_keypoints(self, line: dict[str, Any]) -> None:
        """In the order of the craft's own; null where COCO has none."""
        points = line.pop("keypoints", None)
        known = self.spacecraft_by_name[line["spacecraft"]] if "spacecraft" in line else None
        if points is not None and known is not None and known.keypoints_body_m:
            none = [None, None, 0]
            line["keypoints"] = {name: points.get(name, none) for name in known.keypoints_body_m}

    # An attribute there; here read when asked for, since boxes need no camera.
    @cached_property
    def camera(self) -> Camera:  # type: ignore[override]
        """Of ``camera.json`` beside the files.

        Raises:
            InputError: there is none.
        """
        return read_camera(self.folder / "camera.json")

    @cached_property
    def manifest(self) -> Mapping[str, Any]:
        """Digests of the COCO files and of the images."""
        files = [str(file.relative_to(self.folder)) for file in self._files.values()]
        paths = [*files, *(line["image"] for line in self._lines)]
        try:
            return {"sha256": {path: sha256(self.folder / path) for path in paths}}
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from None

    @property
    def frames(self) -> Frames:
        return _CocoFrames(self._lines)

    def frame(self, index: int) -> dict[str, Any]:
        if not 0 <= index < len(self._lines):
            raise InputError(f"{self.folder}: has no frame {index}")
        return dict(self._lines[index])

    @property
    def is_divided(self) -> bool:
        """Never by 'posse partition'."""
        return False

    def part(self, name: str) -> list[int]:
        if name not in self._parts and name in PARTS and "train" in self._parts:
            return []
        if name not in self._parts:
            raise InputError(f"{self.folder}: has no part {name!r}; it has {', '.join(self._parts)}")
        return self._parts[name]

    def size_px(self, index: int) -> tuple[int, int]:
        return self._sizes[index]


class _CocoFrames(Frames):
    def __init__(self, lines: list[dict[str, Any]]) -> None:
        self._lines = lines
        self.indices = np.arange(len(lines), dtype=np.int64)
        self.damaged = []

    def __getitem__(self, place: Any) -> Any:
        return self._lines[place]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self._lines)
