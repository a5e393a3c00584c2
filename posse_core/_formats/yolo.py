"""YOLO-pose: a text file per image with ``class cx cy w h (x y visibility) …`` as shares of the image.

The share 0 is the image's left or upper border, so the centre u of a pixel is at (u + ½)/width.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import PARTS
from posse_core._errors import InputError
from posse_core._files.atomic import write_bytes
from posse_core._files.reading import read_text
from posse_core._formats.exported import ExportedBody, ExportedImage
from posse_core._formats.images import link_or_copy
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.camera import Camera
from posse_core._model.label_line import BodyLabels
from posse_core._model.labels import NOT_IN_FRAME
from posse_core._scenario.yaml_lines import YamlText

NEEDS = ("box_visible_px", "keypoints")

_HEADER = """\
# Train with fliplr=0 and flipud=0: a mirror image is another spacecraft, and flip_idx exchanges nothing.
"""
_UNDIVIDED = """\
# Not divided: each part has all frames. Run 'posse partition' and export again.
"""


class YoloWriter(Writer):
    """Writes ``yolo/`` with ``data.yaml``, ``images/``, ``labels/`` and a list of images for each part.

    A file has a line for each body of which the image shows a pixel; its class is the name of its
    spacecraft. All lines have the same number of keypoints, as the format asks: spacecraft with fewer
    than others, or with none, are padded with keypoints outside the image.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``yolo``."""
        crafts = [craft for _, craft in sorted(dataset.classes.items())]
        count = max(len(craft.keypoints_body_m) for craft in crafts)
        if count == 0:
            raise InputError(f"{dataset.folder}: no spacecraft has keypoints, which YOLO-pose needs")
        out = folder / "yolo"
        for name in ("images", "labels"):
            (out / name).mkdir(parents=True, exist_ok=True)
        classes = {craft.name: i for i, craft in enumerate(crafts)}
        for labels in labels_with(dataset, "YOLO-pose", NEEDS):
            image = dataset.folder / labels.image
            link_or_copy(image, out / "images" / image.name)
            rows = [
                _row(dataset, body, classes[body.spacecraft], count)
                for body in labels.instances.values()
                if body.box_visible_px is not None
            ]
            write_bytes(out / "labels" / f"{image.stem}.txt", "".join(rows).encode())
        parts = {part: dataset.part(part) if dataset.is_divided else None for part in PARTS}
        for part, positions in parts.items():
            images = (Path(each.image).name for each in labels_with(dataset, "YOLO-pose", (), positions))
            write_bytes(out / f"{part}.txt", "".join(f"./images/{name}\n" for name in images).encode())
        value = {
            "train": "train.txt",
            "val": "valid.txt",
            "test": "test.txt",
            "names": {i: name for name, i in classes.items()},
            "kpt_shape": [count, 3],
            "flip_idx": list(range(count)),
            "kpt_names": {i: list(craft.keypoints_body_m) for i, craft in enumerate(crafts)},
        }
        header = _HEADER if dataset.is_divided else _HEADER + _UNDIVIDED
        text = header + yaml.safe_dump(value, sort_keys=False, default_flow_style=None)
        write_bytes(out / "data.yaml", text.encode())
        lists = [out / f"{part}.txt" for part in parts]
        return [out / "data.yaml", *lists, out / "images", out / "labels"]


def _row(dataset: Dataset, body: BodyLabels, class_: int, count: int) -> str:
    assert body.box_visible_px is not None
    width_px, height_px = dataset.camera.width_px, dataset.camera.height_px
    x, y, width, height = body.box_visible_px
    numbers = [
        (x + width / 2) / width_px,
        (y + height / 2) / height_px,
        width / width_px,
        height / height_px,
    ]
    names = dataset.classes[body.spacecraft].keypoints_body_m
    points = [body.keypoints[name] for name in names]
    for u, v, visibility in [*points, *[(None, None, NOT_IN_FRAME)] * (count - len(points))]:
        if u is None or v is None or visibility == NOT_IN_FRAME:
            numbers += [0, 0, 0]
        else:
            numbers += [(u + 0.5) / width_px, (v + 0.5) / height_px, visibility]
    return " ".join(map(repr, [class_, *numbers])) + "\n"


def read_yolo(folder: Path, camera: Camera) -> Iterator[ExportedImage]:
    """Read the labels of every text file beside a ``data.yaml``.

    Keypoints outside the image are left out.
    """
    data = YamlText.read(folder / "data.yaml").value
    for path in sorted((folder / "labels").glob("*.txt")):
        rows = [[float(number) for number in row.split()] for row in read_text(path).splitlines()]
        bodies = [ExportedBody(_labels(row, data, camera)) for row in rows]
        yield ExportedImage(f"images/{path.stem}.png", bodies)


def _labels(row: Sequence[float], data: Mapping[str, Any], camera: Camera) -> BodyLabels:
    size = (camera.width_px, camera.height_px)
    class_ = int(row[0])
    (cx, cy, width, height), points = row[1:5], iter(row[5:])
    corner = ((cx - width / 2) * size[0], (cy - height / 2) * size[1])
    seen = {
        name: [x * size[0] - 0.5, y * size[1] - 0.5, int(visibility)]
        for name, (x, y, visibility) in zip(
            data["kpt_names"][class_], zip(points, points, points, strict=True), strict=False
        )
        if visibility != NOT_IN_FRAME
    }
    return BodyLabels.model_validate(
        {
            "spacecraft": data["names"][class_],
            "box_visible_px": [*corner, width * size[0], height * size[1]],
            "keypoints": seen,
        },
        strict=False,
    )
