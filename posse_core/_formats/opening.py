"""Opening labelled images of any kind: datasets of ``posse run``, COCO, SPEED, SPEED+ and SHIRT."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from posse_core._dataset.coco import CocoDataset
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.images import LabelledImages
from posse_core._dataset.layout import SCENARIO
from posse_core._errors import InputError
from posse_core._formats.speed_images import SpeedImages, files_of
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.camera import preset_camera
from posse_core._simulator.scene import named_craft

ImageFormat = Literal["posse", "coco", "speed", "speed+", "shirt"]
"""How labelled images are laid out."""
_CAMERA_OF = {"speed": "speed", "speed+": "speed-plus", "shirt": "speed-plus"}
"""The published camera of a format, by its name in scenarios."""
TANGO = "tango"
"""The spacecraft of SPEED, SPEED+ and SHIRT."""


def open_dataset(
    path: str | Path, *, format: ImageFormat | None = None, target: str | Spacecraft = TANGO
) -> LabelledImages:
    """Open labelled images: a dataset of ``posse run``; COCO; or SPEED, SPEED+ and SHIRT.

    COCO is a ``.json`` file with an object, or a folder with such a ``train.json``. SPEED's is a file
    with a list, or a folder such as ``speedplus/lightbox``; its labels are poses, and box, mask and
    keypoints are those of the target's mesh.

    Args:
        path: a folder or a file.
        format: how it is laid out; None finds out. Where SPEED's labels have no ``camera.json``, it says
            which published camera took the images.
        target: with SPEED, SPEED+ and SHIRT, the spacecraft that the images show: a name that 'posse
            plugins' lists as a scene, the folder of a package, or the spacecraft itself.

    Raises:
        InputError: the path is none of these, or does not have the layout.
    """
    path = Path(path)
    if format is not None and format not in get_args(ImageFormat):
        raise InputError(f"format {format!r}: is none of {', '.join(get_args(ImageFormat))}")
    kind = format or _kind_of(path)
    if kind == "coco":
        return CocoDataset(path)
    if kind == "posse":
        return Dataset(path)
    files_of(path)  # raises before the spacecraft is made
    camera = None if format is None else preset_camera(_CAMERA_OF[format])
    craft = named_craft(target, load_plugins().registry) if isinstance(target, str) else target
    return SpeedImages(path, craft, camera)


def _kind_of(path: Path) -> ImageFormat:
    """How a path is laid out, by its files."""
    labels = [path] if path.suffix == ".json" else [path / name for name in ("train.json", "test.json")]
    for file in labels:
        if file.is_file():
            with open(file, encoding="utf-8", errors="replace") as text:
                is_list = text.read(256).lstrip()[:1] == "["
            return "speed+" if is_list else "coco"
    if path.suffix == ".json":
        return "coco"
    folder = path.absolute().parent
    is_sequence = (folder / f"{folder.name}.json").is_file() and not (path / SCENARIO).is_file()
    return "shirt" if is_sequence else "posse"
