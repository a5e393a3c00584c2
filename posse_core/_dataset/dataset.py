"""Reading the folder of a dataset that a run wrote. ``docs/dataset.md`` describes its layout."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, overload

import numpy as np
from pydantic import Field, field_validator

from posse_core._arrays import AnyArray, Float32Array, IntArray
from posse_core._dataset.camera import read_camera
from posse_core._dataset.files import read_arrays
from posse_core._dataset.frame_table import frame_table
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.layout import (
    BODIES,
    CAMERA,
    LABELS,
    MANIFEST,
    PARTITION_FILE,
    SCENARIO,
    SENSORS,
    SPACECRAFT,
    TRAJECTORY,
    inside,
)
from posse_core._dataset.lines import LabelLines
from posse_core._dataset.mesh import Mesh, read_mesh
from posse_core._dataset.readings import read_reading
from posse_core._dataset.sensors import SensorInfo, read_sensor
from posse_core._dataset.spacecraft import SpacecraftInfo, read_bodies, read_spacecraft
from posse_core._errors import InputError
from posse_core._files.atomic import sha256
from posse_core._files.reading import FileRecord, read_bytes, read_record, read_text
from posse_core._files.trajectory import load_trajectory
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine
from posse_core._model.manifest import Manifest
from posse_core._model.reading import Reading
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.options import nearest

if TYPE_CHECKING:
    import pandas as pd

_NUMBERS = "biuf"
"""Kinds of arrays of numbers, in NumPy's letters: bool, signed, unsigned, floating."""
_ONE_NUMBER = ("part_id", "depth_m")
"""Arrays of one number a pixel, which pages and exports read."""


_Share = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Partition(FileRecord):
    """The file that ``posse partition`` writes.

    Attributes:
        parts: part → indices of its frames.
        by: what was shuffled, ``frame`` or ``sequence``.
        seed: by which the parts were drawn; None in lists of another origin.
        shares: of train, valid and test, likewise.
    """

    parts: dict[str, tuple[Annotated[int, Field(ge=0, lt=2**63)], ...]]
    by: str = "frame"
    seed: int | None = None
    shares: tuple[_Share, _Share, _Share] | None = None

    @field_validator("shares")
    @classmethod
    def _not_all_zero(cls, shares: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if shares is not None and not sum(shares) > 0:
            raise ValueError("all shares are 0; give those of train, valid and test")
        return shares


class Dataset(LabelledImages):
    """A dataset made by ``posse run`` or ``posse collect``, as a sequence of label lines.

    ``dataset[i]`` is the :class:`posse_core.LabelLine` of the frame at position ``i``, in ascending
    order of indices. A line is read from its file each time.

    Attributes:
        folder: the folder.
        spacecraft_by_name: all spacecraft in the dataset that are targets, by name.
        bodies: the spacecraft of each body beside the target, by the body's name.
        label_lines: the unparsed lines of the files, damaged or not.

    Raises:
        InputError: The folder is not a dataset; the message says why.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__()
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise InputError(f"{folder}: there is no such folder; give one made by 'posse run'")
        if not (self.folder / LABELS).is_dir():
            within = sorted(path.parent.name for path in self.folder.glob(f"*/{LABELS}"))
            way_out = (
                f"give one of those in it ({', '.join(within)}), or join them with 'posse collect'"
                if within
                else "give one made by 'posse run'"
            )
            raise InputError(f"{folder}: not a dataset (no {LABELS}/); {way_out}")
        self._camera = read_camera(self.folder / CAMERA)
        crafts = sorted((self.folder / SPACECRAFT).glob("*.json"))
        if not crafts:
            raise InputError(f"{folder}: spacecraft/ has no NAME.json; the dataset is incomplete")
        infos = [read_spacecraft(path) for path in crafts]
        self.spacecraft_by_name = {info.name: info for info in infos}
        self.bodies: Mapping[str, SpacecraftInfo] = read_bodies(self.folder / BODIES)
        self._body_meshes: dict[str, Mesh] = {}
        self.label_lines = LabelLines(self.folder / LABELS)

    def __repr__(self) -> str:
        names, camera = ", ".join(self.spacecraft_by_name), self.camera
        state = "no manifest yet"
        if (self.folder / MANIFEST).exists():
            try:
                state = self.manifest.state
            except InputError:
                state = "damaged manifest"
        return (
            f"Dataset({str(self.folder)!r}: {len(self.label_lines)} frames of {names},"
            f" {camera.width_px} × {camera.height_px}, {state})"
        )

    def __len__(self) -> int:
        return len(self._lines)

    @overload
    def __getitem__(self, i: int) -> LabelLine: ...
    @overload
    def __getitem__(self, i: slice) -> list[LabelLine]: ...
    def __getitem__(self, i: int | slice) -> LabelLine | list[LabelLine]:
        if isinstance(i, slice):
            return [self[position] for position in range(*i.indices(len(self)))]
        if not -len(self) <= i < len(self):
            raise IndexError(f"{self.folder}: has {len(self)} frames, and none at position {i}")
        position = i % len(self)
        return self._read(position, self._lines[position])

    def __iter__(self) -> Iterator[LabelLine]:
        for position, line in enumerate(self._lines):
            yield self._read(position, line)

    def _read(self, position: int, line: bytes) -> LabelLine:
        try:
            return LabelLine.from_json(line)
        except InputError as error:
            raise InputError(
                f"{self.folder}/{LABELS}: frame {self.label_lines.indices[position]}: {error}; see"
                " 'posse validate'"
            ) from None

    @cached_property
    def _lines(self) -> LabelLines:
        """The lines, after checking that none is damaged and no index occurs twice."""
        lines = self.label_lines
        if lines.damaged:
            raise InputError(
                f"{self.folder}/{LABELS}/{lines.damaged[0]}: not a label line; restore the file from a"
                " copy, or make the dataset again"
            )
        twice = lines.indices[1:][np.diff(lines.indices) == 0]
        if len(twice):
            raise InputError(
                f"{self.folder}/{LABELS}: frame {twice[0]} is labelled twice; see 'posse validate'"
            )
        return lines

    @property
    def indices(self) -> IntArray:
        """(F,) int64 index of each frame, ascending."""
        return self._lines.indices

    def position(self, index: int) -> int:
        position = int(np.searchsorted(self.indices, index))
        if position == len(self) or self.indices[position] != index:
            raise InputError(f"{self.folder}: has no frame {index}")
        return position

    @property
    def camera(self) -> Camera:
        return self._camera

    @cached_property
    def manifest(self) -> Manifest:
        """Versions, seed, digests and state of the run, which writes this file last.

        Raises:
            InputError: The run has not ended, or the file is damaged.
        """
        path = self.folder / MANIFEST
        if not path.exists():
            raise InputError(
                f"{self.folder}: the run has not ended (no {MANIFEST}); use 'posse run --resume'"
            )
        try:
            return Manifest.from_json(read_bytes(path))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @cached_property
    def digests(self) -> Mapping[str, str]:
        """Image or array file → its SHA-256 when it was written; ``sha256sum`` can check the list."""
        path = inside(self.folder, self.manifest.frame_checksums)
        rows = read_text(path).splitlines() if path.is_file() else []
        files = (row.partition("  ") for row in rows if not row.startswith("#"))
        return {name: digest for digest, _, name in files}

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the dataset's content.

        It is the digest of the digests in the manifest and of the partition. The manifest includes the
        digest of the list of the images' digests.

        Raises:
            InputError: The run has not ended.
        """
        digests = dict(self.manifest.sha256)
        if self.is_divided:
            digests[PARTITION_FILE] = sha256(self.folder / PARTITION_FILE)
        return digest_of(digests)

    @property
    def scenario_sha256(self) -> str:
        return self.manifest.sha256.get(SCENARIO, "")

    @cached_property
    def trajectory(self) -> Trajectory:
        """Motion, attitudes, Sun and illumination; the row of a frame is its index.

        Raises:
            InputError: The file is missing or damaged, or lacks the row of a frame.
        """
        trajectory = load_trajectory(self.folder / TRAJECTORY)
        if len(self) and self.indices[-1] >= len(trajectory):
            raise InputError(
                f"{self.folder / TRAJECTORY}: has {len(trajectory)} rows, and none of frame"
                f" {self.indices[-1]}; see 'posse validate'"
            )
        return trajectory

    @property
    def is_divided(self) -> bool:
        """Whether ``posse partition`` has divided the dataset into parts."""
        return (self.folder / PARTITION_FILE).exists()

    @property
    def partition(self) -> Partition:
        """The parts of the dataset.

        Raises:
            InputError: ``posse partition`` has not divided the dataset, or its file is damaged.
        """
        if not self.is_divided:
            raise InputError(f"{self.folder}: not divided into parts; run 'posse partition' on it first")
        return read_record(self.folder / PARTITION_FILE, Partition, "a partition")

    def part(self, name: str) -> list[int]:
        parts = self.partition.parts
        if name not in parts:
            raise InputError(f"{self.folder}: has no part {name!r}; it has {', '.join(parts)}")
        return [self.position(index) for index in parts[name]]

    def size_px(self, i: int) -> tuple[int, int]:
        return self.camera.height_px, self.camera.width_px

    def truth(self, i: int) -> dict[str, AnyArray]:
        """Return the full-size (H, W, ...) arrays of a frame by name; empty if the run wrote none.

        Raises:
            IndexError: There is no such position.
            InputError: The file is missing or damaged, or has an array of something else.
        """
        name = self[i].truth
        if not name:
            return {}
        path = inside(self.folder, name)
        arrays = read_arrays(path)
        for key, array in arrays.items():
            sides = array.shape if key in _ONE_NUMBER else array.shape[:2]
            if array.dtype.kind not in _NUMBERS or sides != self.size_px(i):
                wanted = ", ".join(map(str, self.size_px(i))) + ("" if key in _ONE_NUMBER else ", ...")
                raise InputError(
                    f"{path}: {key}: is {array.dtype} of shape {array.shape}, and must be numbers of"
                    f" shape ({wanted})"
                )
        return arrays

    @property
    def classes(self) -> Mapping[str, SpacecraftInfo]:
        classes = dict(self.spacecraft_by_name)
        for body, info in self.bodies.items():
            known = classes.setdefault(info.name, info)
            if list(known.keypoints_body_m) != list(info.keypoints_body_m):
                raise InputError(
                    f"{self.folder}: body {body!r} is named {info.name!r} like another spacecraft, but"
                    " has other keypoints; one class cannot hold both"
                )
        return classes

    def loose_keypoints(self, name: str) -> list[str]:
        loose = set(super().loose_keypoints(name))
        places = self.classes[name].keypoints_body_m
        for info in self.bodies.values():
            if info.name == name:
                loose |= info.keypoint_joints.keys()
                loose |= {
                    key
                    for key, x_body_m in info.keypoints_body_m.items()
                    if not np.allclose(x_body_m, places[key], atol=1e-6)
                }
        return sorted(loose)

    def body_mesh(self, body: str) -> Mesh:
        """Return the mesh of a body beside the target.

        Raises:
            InputError: There is no such body, or its file is missing or damaged.
        """
        if body not in self.bodies:
            known = ", ".join(self.bodies) or "it has none"
            raise InputError(
                f"{self.folder}: has no body {body!r}{nearest(body, self.bodies)} ({known})"
            )
        if body not in self._body_meshes:
            path = self.folder / BODIES / body / f"{self.bodies[body].name}.ply"
            self._body_meshes[body] = read_mesh(path)
        return self._body_meshes[body]

    @cached_property
    def sensors(self) -> Mapping[str, SensorInfo]:
        """The sensors beside the camera, by name.

        Raises:
            InputError: a sensor's file is damaged.
        """
        paths = sorted((self.folder / SENSORS).glob("*.json"))
        return {path.stem: read_sensor(path) for path in paths}

    def readings(self, i: int, sensor: str) -> tuple[Reading, ...]:
        """The readings of a sensor at a frame, in order of their instants.

        Their instants and poses are in the label line, ``dataset[i].sensors[sensor]``.

        Raises:
            IndexError: there is no such position.
            InputError: there is no such sensor, or a file is missing or damaged.
        """
        labels = self[i]
        taken = labels.sensors if labels.has("sensors") else {}
        if sensor not in taken:
            raise InputError(
                f"{self.folder}: frame {labels.index} has no sensor {sensor!r}{nearest(sensor, taken)}"
                f" ({', '.join(taken) or 'it has none'})"
            )
        return tuple(read_reading(self.folder, reading) for reading in taken[sensor])

    def depth(self, i: int) -> Float32Array:
        """(H, W) float32 planar z of a frame, metres; NaN off the spacecraft.

        Raises:
            IndexError: there is no such position.
            InputError: the run made no depth, or the file is missing or damaged.
        """
        depth_m = self.truth(i).get("depth_m")
        if depth_m is None:
            raise InputError(
                f"{self.folder}: frame {self[i].index} has no depth; add 'depth' to the scenario's"
                " annotators"
            )
        return depth_m.astype(np.float32, copy=False)

    def dataframe(self) -> pd.DataFrame:
        """One row a frame, by position; one column a number, its unit in the name (docs/dataset.md).

        Raises:
            ComponentError: pandas is not installed.
        """
        return frame_table(self)


def digest_of(digests: Mapping[str, str]) -> str:
    """Hexadecimal SHA-256 of a list of digests by path."""
    rows = "".join(f"{digests[path]}  {path}\n" for path in sorted(digests))
    return hashlib.sha256(rows.encode()).hexdigest()
