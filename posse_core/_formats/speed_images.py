"""Folders of SPEED, SPEED+ and SHIRT as datasets: images with the pose of one spacecraft.

Their labels are poses alone. Box, mask and keypoints are those of the spacecraft's mesh at the pose, by
the rays that label POSSE's own frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import overload

import numpy as np

from posse_core._annotators.exact import keypoint_labels, run_lengths, visible_box
from posse_core._arrays import FloatArray
from posse_core._dataset.dataset import digest_of
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.spacecraft import SpacecraftInfo, mesh_of
from posse_core._errors import InputError
from posse_core._files.atomic import sha256
from posse_core._files.reading import parsed_json, read_bytes
from posse_core._formats.poses import camera_beside, read_poses
from posse_core._frames import matrix_from_quaternion
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera
from posse_core._model.craft_state import CraftState
from posse_core._model.label_line import LabelLine
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft

_FILES = {"train": "train.json", "valid": "validation.json", "test": "test.json"}
"""Part → file of labels, as SPEED and SPEED+ name them."""


@dataclass(frozen=True)
class _Frame:
    image: str
    q_cam_from_body: FloatArray
    t_body_cam_m: FloatArray


class SpeedImages(LabelledImages):
    """Images of SPEED, SPEED+ or SHIRT.

    A folder has its parts in ``train.json``, ``validation.json`` and ``test.json``; a folder of SHIRT
    has the part ``test``, with the labels of the folder above, ``roe1/roe1.json`` for ``roe1/lightbox``;
    a file is a dataset of one part, ``all``. Images are in ``images/``, in ``images/PART/`` (SPEED), or
    beside the labels. Frames are numbered from 0 in the order of the files.

    Raises:
        InputError: a file is missing or has no poses, or no camera is known.
    """

    def __init__(self, path: Path, spacecraft: Spacecraft, camera: Camera | None) -> None:
        """Read the labels.

        Args:
            path: a folder, or a file of labels.
            spacecraft: that the images show.
            camera: that took the images; used if no ``camera.json`` is beside the labels or above.
        """
        super().__init__()
        self._files = files_of(path)
        self.folder = path.parent if path.suffix == ".json" else path
        found = camera_beside(next(iter(self._files.values()))) or camera
        if found is None:
            raise InputError(
                f"{path}: has no camera.json beside its labels or above; put it there, or give --format"
                " speed, speed+ or shirt, whose cameras are published"
            )
        self._camera = found
        self._frames: list[_Frame] = []
        self._parts: dict[str, list[int]] = {}
        for part, labels in self._files.items():
            poses = read_poses(labels)
            first, images = len(self._frames), self._images(labels, poses.names)
            rows = zip(images, poses.q_cam_from_body, poses.t_body_cam_m, strict=True)
            self._frames += [_Frame(*row) for row in rows]
            self._parts[part] = list(range(first, len(self._frames)))
        self._spacecraft = spacecraft
        info = SpacecraftInfo(
            name=spacecraft.name,
            parts=tuple(part.name for part in spacecraft.parts),
            keypoints_body_m=spacecraft.keypoints_body_m,
            skeleton=tuple(spacecraft.skeleton),
            symmetries=tuple(spacecraft.symmetries),
        )
        self.spacecraft_by_name: Mapping[str, SpacecraftInfo] = {info.name: info}
        self._meshes[info.name] = mesh_of(spacecraft)
        self._caster = RayCaster(Scene(spacecraft, found))
        self._last: LabelLine | None = None

    def _images(self, labels: Path, names: tuple[str, ...]) -> list[str]:
        """The images' paths within the folder."""
        for name in names:
            if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
                raise InputError(f"{labels}: the image {name!r} is outside the labels' folder")
        folders = ["images", f"images/{labels.stem}", "."]
        for folder in folders:
            if (self.folder / folder / names[0]).is_file():
                return [(PurePath(folder) / name).as_posix() for name in names]
        where = ", ".join(str(self.folder / folder) for folder in folders)
        raise InputError(f"{labels}: its image {names[0]} is in none of {where}")

    def __repr__(self) -> str:
        return f"SpeedImages({str(self.folder)!r}: {len(self)} images of {self._spacecraft.name})"

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, i: int) -> LabelLine: ...
    @overload
    def __getitem__(self, i: slice) -> list[LabelLine]: ...
    def __getitem__(self, i: int | slice) -> LabelLine | list[LabelLine]:
        if isinstance(i, slice):
            return [self._line(position) for position in range(len(self))[i]]
        return self._line(range(len(self))[i])

    def _line(self, position: int) -> LabelLine:
        """The labels of a frame; those of the last one asked for are kept, since its image follows."""
        if self._last is None or self._last.index != position:
            self._last = self._labelled(position)
        return self._last

    def _labelled(self, position: int) -> LabelLine:
        frame = self._frames[position]
        view = self._caster.view(
            CraftState.unlit(matrix_from_quaternion(frame.q_cam_from_body), frame.t_body_cam_m)
        )
        return LabelLine.model_validate(
            {
                "index": position,
                "image": frame.image,
                "spacecraft": self._spacecraft.name,
                "box_visible_px": visible_box(view),
                "mask_rle": run_lengths(view, self._camera),
                "mask_area_px": int(view.mask.sum()),
                "keypoints": keypoint_labels(self._spacecraft, view),
                "q_cam_from_body": frame.q_cam_from_body.tolist(),
                "t_body_cam_m": frame.t_body_cam_m.tolist(),
                "range_m": float(np.linalg.norm(frame.t_body_cam_m)),
            },
            strict=False,
        )

    def position(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise InputError(f"{self.folder}: has no frame {index}")
        return index

    @property
    def camera(self) -> Camera:
        return self._camera

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the labels and the images.

        Raises:
            InputError: One of them cannot be read.
        """
        files = {file.name: file for file in self._files.values()}
        files |= {frame.image: self.folder / frame.image for frame in self._frames}
        try:
            return digest_of({name: sha256(path) for name, path in files.items()})
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from None

    def part(self, name: str) -> list[int]:
        if name not in self._parts and name in _FILES and "train" in self._parts:
            return []
        if name not in self._parts:
            raise InputError(f"{self.folder}: has no part {name!r}; it has {', '.join(self._parts)}")
        return self._parts[name]

    def size_px(self, i: int) -> tuple[int, int]:
        return self._camera.height_px, self._camera.width_px


def files_of(path: Path) -> dict[str, Path]:
    """Part → file of labels. Files without poses, as SPEED's ``test.json``, are left out.

    Raises:
        InputError: the path is neither a file nor a folder laid out as SPEED, SPEED+ or SHIRT.
    """
    if path.suffix == ".json":
        return {"all": path}
    files = {part: path / name for part, name in _FILES.items() if (path / name).is_file()}
    found = {part: file for part, file in files.items() if not _is_of_names(file)}
    sequence = path.absolute().parent
    if not files and (sequence / f"{sequence.name}.json").is_file():
        return {"test": sequence / f"{sequence.name}.json"}
    if not found:
        raise InputError(
            f"{path}: has none of {', '.join(_FILES.values())} of SPEED and SPEED+, and"
            f" {sequence / sequence.name}.json of SHIRT is not there; name a folder such as"
            " speedplus/lightbox or shirtv1/roe1/lightbox, or a file of labels"
        )
    return found


def _is_of_names(file: Path) -> bool:
    """Whether a list has names of images alone."""
    value = parsed_json(read_bytes(file), str(file))
    return isinstance(value, list) and all(
        isinstance(entry, dict) and entry.keys() == {"filename"} for entry in value
    )
