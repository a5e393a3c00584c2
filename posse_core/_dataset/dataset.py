"""A dataset on disk: the folder that a run writes, read. Its layout stands in ``docs/dataset.md``."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any, BinaryIO, overload

import cv2
import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._dataset.mesh import Mesh, read_mesh, write_mesh
from posse_core._errors import InputError
from posse_core._files.atomic import sha256, write_json
from posse_core._model.camera import Camera
from posse_core._model.distortion import BrownConrady
from posse_core._model.spacecraft import Spacecraft

PARTS = ("train", "valid", "test")
"""Names of the parts that ``posse partition`` divides a dataset into."""
PARTITION_FILE = "partition/partition.json"


@dataclass(frozen=True)
class SpacecraftInfo:
    """A spacecraft as the labels know it; its mesh is read apart, by :meth:`Dataset.mesh`.

    Attributes:
        name: the class name.
        parts: names; a part's id in the labels is its place here.
        keypoints_body_m: name → (3,) metres, body frame, in the labels' order.
        skeleton: pairs of keypoint names to draw lines between.
        symmetries: rotations (3, 3) that leave the looks unchanged, without the identity.
    """

    name: str
    parts: tuple[str, ...]
    keypoints_body_m: Mapping[str, FloatArray]
    skeleton: tuple[tuple[str, str], ...]
    symmetries: tuple[FloatArray, ...]


class Frames(Sequence[dict[str, Any]]):
    """Label lines of a dataset in the order of their index, read from the shards when asked for.

    Only each line's place is kept, so memory does not grow with what the labels hold. A last line
    without its line feed was cut short when a run was killed: that frame was never done.

    Attributes:
        indices: (F,) int64, ascending; an index labelled twice is here twice.
        damaged: ``"shard, line n"`` of each complete line that is not a label.
    """

    def __init__(self, folder: Path) -> None:
        self._shards = sorted(folder.glob("shard-*.jsonl"))
        self.damaged: list[str] = []
        entries: list[tuple[int, int, int]] = []
        for shard, path in enumerate(self._shards):
            with open(path, "rb") as stream:
                offset = 0
                for number, line in enumerate(stream, 1):
                    if not line.endswith(b"\n"):
                        break
                    index = _index_of(line)
                    if index is None:
                        self.damaged.append(f"{path.name}, line {number}")
                    else:
                        entries.append((index, shard, offset))
                    offset += len(line)
        table = np.array(entries, dtype=np.int64).reshape(-1, 3)
        table = table[np.argsort(table[:, 0], kind="stable")]
        self.indices, self._shard, self._offset = table.T

    def __len__(self) -> int:
        return len(self.indices)

    @overload
    def __getitem__(self, place: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, place: slice) -> list[dict[str, Any]]: ...
    def __getitem__(self, place: int | slice) -> dict[str, Any] | list[dict[str, Any]]:
        if isinstance(place, slice):
            return [self[i] for i in range(*place.indices(len(self)))]
        with open(self._shards[self._shard[place]], "rb") as stream:
            return self._read(stream, place)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for shard, places in groupby(range(len(self)), key=self._shard.__getitem__):
            with open(self._shards[shard], "rb") as stream:
                yield from (self._read(stream, place) for place in places)

    def _read(self, stream: BinaryIO, place: int) -> dict[str, Any]:
        stream.seek(self._offset[place])
        line: dict[str, Any] = json.loads(stream.readline())
        return line


def _index_of(line: bytes) -> int | None:
    try:
        index = json.loads(line)["index"]
    except (ValueError, KeyError, TypeError):
        return None
    return index if isinstance(index, int) and index >= 0 else None


class Dataset:
    """A folder made by ``posse run``.

    Attributes:
        folder: the folder.
        camera: intrinsics.
        spacecraft_by_name: every spacecraft that the labels speak of.
        label_lines: all label lines, with the places of damaged ones.

    Raises:
        posse_core._errors.InputError: the folder is not a dataset; the message says why.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise InputError(f"{folder}: there is no such folder; name one made by 'posse run'")
        if not (self.folder / "labels").is_dir():
            within = sorted(path.parent.name for path in self.folder.glob("*/labels"))
            way_out = (
                f"name one of those in it ({', '.join(within)}), or join them by 'posse collect'"
                if within
                else "name one made by 'posse run'"
            )
            raise InputError(f"{folder}: not a dataset (no labels/); {way_out}")
        self.camera = read_camera(self.folder / "camera.json")
        crafts = sorted((self.folder / "spacecraft").glob("*.json"))
        if not crafts:
            raise InputError(f"{folder}: spacecraft/ has no NAME.json; the dataset is incomplete")
        infos = [read_spacecraft(path) for path in crafts]
        self.spacecraft_by_name: Mapping[str, SpacecraftInfo] = {info.name: info for info in infos}
        self.label_lines = Frames(self.folder / "labels")
        self._meshes: dict[str, Mesh] = {}

    @cached_property
    def manifest(self) -> Mapping[str, Any]:
        """Versions, seed, hashes and state of the run, which writes it last.

        Raises:
            InputError: the run has not ended.
        """
        path = self.folder / "manifest.json"
        if not path.exists():
            raise InputError(
                f"{self.folder}: the run has not ended (no manifest.json); end it by"
                " 'posse run --resume'"
            )
        return read_json(path)

    @property
    def spacecraft(self) -> SpacecraftInfo:
        """The one spacecraft of the dataset.

        Raises:
            InputError: it has several; take :attr:`spacecraft_by_name`.
        """
        if len(self.spacecraft_by_name) > 1:
            names = ", ".join(self.spacecraft_by_name)
            raise InputError(f"{self.folder}: has several spacecraft ({names}) where one is needed")
        return next(iter(self.spacecraft_by_name.values()))

    @cached_property
    def frames(self) -> Frames:
        """Labels of every frame, by ascending index.

        Raises:
            InputError: a label line is damaged, or an index is labelled twice.
        """
        lines = self.label_lines
        if lines.damaged:
            raise InputError(
                f"{self.folder}/labels/{lines.damaged[0]}: not a label; restore the file from a copy,"
                " or make the dataset again"
            )
        twice = lines.indices[1:][np.diff(lines.indices) == 0]
        if len(twice):
            raise InputError(
                f"{self.folder}/labels: frame {twice[0]} is labelled twice; see 'posse validate'"
            )
        return lines

    @cached_property
    def digests(self) -> Mapping[str, str]:
        """Image or array file → its SHA-256 when it was written; ``sha256sum`` reads the list too."""
        path = self.folder / str(self.manifest.get("frame_checksums", "checksums.sha256"))
        rows = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        files = (row.partition("  ") for row in rows if not row.startswith("#"))
        return {name: digest for digest, _, name in files}

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of what the dataset holds: over the digests that the manifest lists, and
        the division into parts. Images' own digests are in a list of theirs, which is hashed there.

        Raises:
            InputError: the run has not ended.
        """
        digests = dict(self.manifest["sha256"])
        if self.is_divided:
            digests[PARTITION_FILE] = sha256(self.folder / PARTITION_FILE)
        rows = "".join(f"{digests[path]}  {path}\n" for path in sorted(digests))
        return hashlib.sha256(rows.encode()).hexdigest()

    def frame(self, index: int) -> dict[str, Any]:
        """Labels of the frame with this index.

        Raises:
            InputError: no such frame.
        """
        place = int(np.searchsorted(self.frames.indices, index))
        if place == len(self.frames) or self.frames.indices[place] != index:
            raise InputError(f"{self.folder}: has no frame {index}")
        return self.frames[place]

    @property
    def is_divided(self) -> bool:
        """Whether ``posse partition`` has been run on it."""
        return (self.folder / PARTITION_FILE).exists()

    def part(self, name: str) -> list[int]:
        """Indices of the frames in one part (``train``, ``valid``, ``test``), ascending.

        Raises:
            InputError: the dataset has not been divided, or has no such part.
        """
        if not self.is_divided:
            raise InputError(f"{self.folder}: not divided into parts; run 'posse partition' on it")
        parts = read_json(self.folder / PARTITION_FILE)["parts"]
        if name not in parts:
            raise InputError(f"{self.folder}: has no part {name!r}; it has {', '.join(parts)}")
        return list(parts[name])

    def size_px(self, index: int) -> tuple[int, int]:
        """Height and width of the image that the labels of a frame are for."""
        return self.camera.height_px, self.camera.width_px

    def image(self, index: int) -> AnyArray:
        """(H, W) or (H, W, 3) red-green-blue image of a frame, uint8 or uint16.

        Raises:
            InputError: no such frame, or its file is missing, damaged, or of another size.
        """
        path = self.folder / self.frame(index)["image"]
        image = read_image(path)
        found, wanted = image.shape[:2], self.size_px(index)
        if found != wanted:
            raise InputError(
                f"{path}: is {found[1]} × {found[0]} pixels, where its labels are for"
                f" {wanted[1]} × {wanted[0]}"
            )
        return image

    def truth(self, index: int) -> dict[str, AnyArray]:
        """Full-size (H, W, ...) arrays of a frame by name; empty where the run wrote none.

        Raises:
            InputError: no such frame, or its file is missing or damaged.
        """
        name = self.frame(index)["truth"]
        return read_arrays(self.folder / name) if name else {}

    def mesh(self, name: str | None = None) -> Mesh:
        """The triangles of a spacecraft (the one of the dataset, if None).

        Raises:
            InputError: no such spacecraft, or its file is missing or damaged.
        """
        name = self.spacecraft.name if name is None else name
        if name not in self._meshes:
            self._meshes[name] = read_mesh(self.folder / "spacecraft" / f"{name}.ply")
        return self._meshes[name]


def read_image(path: Path) -> AnyArray:
    """(H, W) or (H, W, 3) red-green-blue, uint8 or uint16.

    Raises:
        InputError: the file is missing, or not an image.
    """
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.exists() else None
    if image is None:
        raise InputError(f"{path}: {'not an image' if path.exists() else 'missing'}")
    return np.asarray(image if image.ndim == 2 else image[..., 2::-1])


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Arrays of an ``.npz`` file by name.

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return dict(arrays)
    except Exception as error:  # zipfile, zlib and numpy each raise their own on a damaged file
        raise InputError(f"{path}: cannot be read: {error}") from None


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file.

    Raises:
        InputError: the file is missing, or holds none.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds no JSON object")
    return value


def write_camera(camera: Camera, path: Path) -> None:
    """Write the intrinsics with the keys of SPEED+'s ``camera.json``.

    ``ppx``, ``ppy`` are the pixel's width and height and ``fx``, ``fy`` the focal lengths, in metres;
    ``cameraMatrix`` is in pixels, with the centre of the top-left pixel at (0, 0); ``distCoeffs`` are
    k₁, k₂, p₁, p₂, k₃. ``lineTime_s`` is ours.
    """
    pitch_m = camera.pixel_pitch_m
    value = {
        "Nu": camera.width_px,
        "Nv": camera.height_px,
        "ppx": pitch_m,
        "ppy": pitch_m,
        "fx": camera.fx_px * pitch_m,
        "fy": camera.fy_px * pitch_m,
        "cameraMatrix": camera.matrix.tolist(),
        "lineTime_s": camera.line_time_s,
        "distCoeffs": camera.distortion_coefficients.tolist(),
    }
    write_json(path, value)


def read_camera(path: Path) -> Camera:
    """Read what :func:`write_camera` wrote.

    Raises:
        InputError: the file is missing, or is not of that kind.
    """
    value = read_json(path)
    try:
        K, coefficients = value["cameraMatrix"], [float(x) for x in value.get("distCoeffs", [])]
        if any(coefficients[5:]):
            raise ValueError("distCoeffs has more than the five coefficients of Brown and Conrady")
        return Camera(
            width_px=int(value["Nu"]),
            height_px=int(value["Nv"]),
            fx_px=float(K[0][0]),
            fy_px=float(K[1][1]),
            cx_px=float(K[0][2]),
            cy_px=float(K[1][2]),
            sensor_width_m=float(value["ppx"] * value["Nu"]),
            line_time_s=float(value.get("lineTime_s", 0)),
            distortion=BrownConrady(*coefficients[:5]) if any(coefficients) else None,
        )
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a camera file: {type(error).__name__}: {error}") from None


def write_spacecraft(spacecraft: Spacecraft, folder: Path) -> None:
    """Write ``NAME.json`` and ``NAME.ply`` (binary, body frame, metres, float64, a part id a face)."""
    value = {
        "name": spacecraft.name,
        "parts": [part.name for part in spacecraft.parts],
        "keypoints": {k: np.asarray(x).tolist() for k, x in spacecraft.keypoints_body_m.items()},
        "skeleton": [list(pair) for pair in spacecraft.skeleton],
        "symmetries": [np.asarray(R).tolist() for R in spacecraft.symmetries],
    }
    parts = spacecraft.parts
    first_vertex = np.cumsum([0, *(len(part.vertices_body_m) for part in parts)])
    mesh = Mesh(
        vertices_body_m=np.concatenate([part.vertices_body_m for part in parts]),
        faces=np.concatenate([part.faces + first_vertex[i] for i, part in enumerate(parts)]),
        part_id=np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts]),
    )
    write_mesh(mesh, folder / f"{spacecraft.name}.ply")
    write_json(folder / f"{spacecraft.name}.json", value)


def read_spacecraft(path: Path) -> SpacecraftInfo:
    """Read the ``NAME.json`` of :func:`write_spacecraft`.

    Raises:
        InputError: the file is missing, or is not of that kind.
    """
    value = read_json(path)
    try:
        return SpacecraftInfo(
            name=str(value["name"]),
            parts=tuple(value["parts"]),
            keypoints_body_m={k: np.array(x, dtype=np.float64) for k, x in value["keypoints"].items()},
            skeleton=tuple((str(a), str(b)) for a, b in value["skeleton"]),
            symmetries=tuple(np.array(R, dtype=np.float64) for R in value["symmetries"]),
        )
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a spacecraft file: {type(error).__name__}: {error}") from None
