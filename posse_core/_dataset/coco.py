"""Reading COCO files, and datasets that consist of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from glob import escape
from pathlib import Path
from typing import Any, overload

from pydantic import ValidationError

from posse_core._dataset.camera import read_camera
from posse_core._dataset.coco_file import CocoAnnotation, CocoCategory, CocoFile, Id
from posse_core._dataset.dataset import digest_of
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.layout import BODIES, CAMERA, PARTS, spacecraft_file
from posse_core._dataset.spacecraft import SpacecraftInfo, read_spacecraft
from posse_core._errors import InputError
from posse_core._files.atomic import sha256
from posse_core._files.reading import read_record
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels, Keypoint, LabelLine, first_fault
from posse_core._model.labels import NOT_IN_FRAME


def read_coco(path: Path) -> Iterator[LabelLine]:
    """Read the labels of every image of a COCO file, in its order, with indices from 0.

    An image without an annotation has the box null and no spacecraft. Of several annotations, the first
    without an ``instance`` is of the target; the others are of bodies beside it, each named by its
    ``instance`` or its id. Keypoints outside the image are left out.

    Raises:
        InputError: The file cannot be read, or does not have the structure of COCO.
    """
    return iter(_read(path).lines)


@dataclass(frozen=True)
class _CocoFile:
    lines: list[LabelLine]
    sizes: list[tuple[int, int]]
    categories: set[str]


def _read(path: Path) -> _CocoFile:
    value = read_record(path, CocoFile, "valid COCO")
    try:
        lines = [LabelLine(index=i, **labels) for i, labels in enumerate(_labels(value))]
    except ValidationError as error:
        raise InputError(f"{path}: not valid COCO: {first_fault(error)}") from None
    except ValueError as error:
        raise InputError(f"{path}: not valid COCO: {error}") from None
    sizes = [(image.height, image.width) for image in value.images]
    return _CocoFile(lines, sizes, {category.name for category in value.categories})


def _labels(value: CocoFile) -> Iterator[dict[str, Any]]:
    """Yield the fields of the :class:`LabelLine` of every image.

    Raises:
        ValueError: An annotation is of no category or contradicts itself or another.
    """
    categories = {category.id: category for category in value.categories}
    annotations_of: dict[Id, list[CocoAnnotation]] = {}
    ids = set()
    for annotation in value.annotations:
        if annotation.id in ids:
            raise ValueError(f"two annotations have the id {annotation.id!r}")
        if annotation.category_id not in categories:
            raise ValueError(
                f"annotation {annotation.id!r} is of the category {annotation.category_id!r}, which is"
                " not there"
            )
        ids.add(annotation.id)
        annotations_of.setdefault(annotation.image_id, []).append(annotation)
    for image in value.images:
        labels: dict[str, Any] = {"image": image.file_name, "box_visible_px": None}
        bodies: dict[str, Any] = {}
        for annotation in annotations_of.get(image.id, ()):
            fields = _fields(annotation, categories[annotation.category_id])
            if annotation.instance is None and "spacecraft" not in labels:
                labels |= fields
                continue
            name = str(annotation.instance or annotation.id)
            if name in bodies:
                raise ValueError(f"image {image.id!r} has two annotations of {name!r}")
            bodies[name] = fields
        if bodies:
            labels["bodies"] = bodies
        yield labels


def _fields(annotation: CocoAnnotation, category: CocoCategory) -> dict[str, Any]:
    """The labels of one body.

    Raises:
        ValueError: It has a mask without an area, an attitude without a position, or other keypoints
            than its category.
    """
    labels: dict[str, Any] = {"spacecraft": category.name, "box_visible_px": annotation.bbox}
    if isinstance(annotation.segmentation, dict):
        if annotation.area is None:
            raise ValueError(f"annotation {annotation.id!r} has a mask and no area")
        labels["mask_rle"] = annotation.segmentation
        labels["mask_area_px"] = round(annotation.area)
    if annotation.q_cam_from_body is not None:
        if annotation.t_body_cam_m is None:
            raise ValueError(f"annotation {annotation.id!r} has q_cam_from_body and no t_body_cam_m")
        labels["q_cam_from_body"] = annotation.q_cam_from_body
        labels["t_body_cam_m"] = annotation.t_body_cam_m
        labels["range_m"] = math.hypot(*annotation.t_body_cam_m)
    if annotation.keypoints is not None:
        if len(annotation.keypoints) != 3 * len(category.keypoints):
            raise ValueError(
                f"annotation {annotation.id!r}: {len(annotation.keypoints)} numbers are not three a"
                f" keypoint of {category.name!r}"
            )
        flat = iter(annotation.keypoints)
        points = zip(category.keypoints, zip(flat, flat, flat, strict=True), strict=True)
        labels["keypoints"] = {name: p for name, p in points if p[2] != NOT_IN_FRAME}
    return labels


class CocoDataset(LabelledImages):
    """Images of spacecraft, with boxes and keypoints from COCO files.

    A folder has its parts in ``train.json``, ``valid.json`` and ``test.json``, of which the last two may
    be missing; a single file is a dataset of one part, ``all``. Image paths are relative to the folder.
    An annotation may have a pose, by the keys ``q_cam_from_body`` and ``t_body_cam_m`` of label lines.
    COCO has neither the camera nor the positions of keypoints on the spacecraft. They are read from
    ``camera.json``, ``spacecraft/NAME.json`` and ``spacecraft/NAME.ply`` beside the COCO files, as in a
    dataset of ``posse run`` (of bodies beside the target also ``bodies/BODY/NAME.json``); without
    ``NAME.json`` there are only boxes.

    Frames are numbered from 0 in the order of the files, so index and position are the same.

    Raises:
        InputError: A file is missing, or is not valid COCO.
    """

    def __init__(self, path: str | Path) -> None:
        super().__init__()
        path = Path(path)
        self.folder = path.parent if path.suffix == ".json" else path
        named = {part: path / f"{part}.json" for part in PARTS}
        self._files = (
            {"all": path}
            if path.suffix == ".json"
            else {part: file for part, file in named.items() if file.is_file()}
        )
        self._lines: list[LabelLine] = []
        self._sizes: list[tuple[int, int]] = []
        self._parts: dict[str, list[int]] = {}
        names: set[str] = set()
        for part, file in self._files.items():
            read, first = _read(file), len(self._lines)
            self._lines += read.lines
            self._sizes += read.sizes
            names |= read.categories
            self._parts[part] = list(range(first, len(self._lines)))
        if not self._lines:
            raise InputError(f"{path}: has no images")
        self.spacecraft_by_name = {name: self._craft(name) for name in sorted(names)}
        self._lines = [self._of_craft(index, line) for index, line in enumerate(self._lines)]

    def _craft(self, name: str) -> SpacecraftInfo:
        beside = sorted(self.folder.glob(f"{BODIES}/*/{escape(name)}.json"))
        for path in (spacecraft_file(self.folder, name), *beside):
            if path.is_file():
                return read_spacecraft(path)
        return SpacecraftInfo(name, (), {}, (), ())

    def _of_craft(self, index: int, line: LabelLine) -> LabelLine:
        """Return a line with its index in the dataset and the keypoints of the spacecraft's files."""
        labels = self._with_keypoints(line) | {"index": index}
        if line.has("bodies"):
            labels["bodies"] = {
                name: BodyLabels(**self._with_keypoints(body)) for name, body in line.bodies.items()
            }
        return LabelLine(**labels)

    def _with_keypoints(self, body: BodyLabels) -> dict[str, Any]:
        """Return labels with their keypoints in the order of the spacecraft's file, and with None where
        COCO has none. Without the file they are left out."""
        labels = {name: value for name, value in body if name != "keypoints"}
        if body.has("keypoints"):
            none = Keypoint(None, None, 0)
            known = self.spacecraft_by_name[body.spacecraft].keypoints_body_m
            if known:
                labels["keypoints"] = {name: body.keypoints.get(name, none) for name in known}
        return labels

    def __repr__(self) -> str:
        names = ", ".join(self.spacecraft_by_name)
        return f"CocoDataset({str(self.folder)!r}: {len(self)} images of {names})"

    def __len__(self) -> int:
        return len(self._lines)

    @overload
    def __getitem__(self, i: int) -> LabelLine: ...
    @overload
    def __getitem__(self, i: slice) -> list[LabelLine]: ...
    def __getitem__(self, i: int | slice) -> LabelLine | list[LabelLine]:
        return self._lines[i]

    def position(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise InputError(f"{self.folder}: has no frame {index}")
        return index

    @cached_property
    def camera(self) -> Camera:
        return read_camera(self.folder / CAMERA)

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the COCO files and the images.

        Raises:
            InputError: One of them cannot be read.
        """
        files = [str(file.relative_to(self.folder)) for file in self._files.values()]
        paths = [*files, *(line.image for line in self._lines)]
        try:
            return digest_of({path: sha256(self.folder / path) for path in paths})
        except OSError as error:
            raise InputError(f"{error.filename}: cannot be read: {error.strerror}") from None

    def part(self, name: str) -> list[int]:
        if name not in self._parts and name in PARTS and "train" in self._parts:
            return []
        if name not in self._parts:
            raise InputError(f"{self.folder}: has no part {name!r}; it has {', '.join(self._parts)}")
        return self._parts[name]

    def size_px(self, i: int) -> tuple[int, int]:
        return self._sizes[i]
