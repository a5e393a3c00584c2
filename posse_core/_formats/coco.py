"""COCO: boxes, segmentation and keypoints in one ``coco.json`` (Lin et al. 2014, and cocodataset.org).

A keypoint outside the image is written as COCO's unlabelled keypoint: 0, 0, 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from posse_core import __version__
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._files.text import text_file, write_items
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.labels import NOT_IN_FRAME

KEYPOINT_SIGMA = 0.025
"""Sigma of the object keypoint similarity for all keypoints: that of the eye, COCO's smallest."""

NEEDS = ("box_visible_px",)


class CocoWriter(Writer):
    """Writes ``coco.json``, which pycocotools loads.

    The id of an image is the index of its frame. Each body of which the image shows a pixel has an
    annotation, whose category is the name of its spacecraft; those beside the target have their own name
    as ``instance``. Without the annotators ``mask`` and ``keypoints`` these members are left out, and
    the area is that of the box.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write ``coco.json``."""
        path = folder / "coco.json"
        category = {name: i for i, name in enumerate(sorted(dataset.classes), 1)}
        with text_file(path) as text:
            text.write('{"info": ')
            text.write(f'{{"description": "POSSE dataset", "version": "{__version__}"}},\n"images": ')
            write_items(text, _images(dataset))
            text.write(',\n"annotations": ')
            write_items(text, _annotations(dataset, category))
            text.write(',\n"categories": ')
            crafts = dataset.classes
            write_items(text, (category_record(crafts[name], id_) for name, id_ in category.items()))
            text.write("}\n")
        return [path]


def _images(dataset: Dataset) -> Iterator[dict[str, Any]]:
    for labels in dataset:
        yield {
            "id": labels.index,
            "file_name": labels.image,
            "width": dataset.camera.width_px,
            "height": dataset.camera.height_px,
        }


def _annotations(dataset: Dataset, category: dict[str, int]) -> Iterator[dict[str, Any]]:
    id_, crafts = 0, dataset.classes
    for labels in labels_with(dataset, "COCO", NEEDS):
        for name, body in labels.instances.items():
            box = body.box_visible_px
            if box is None:
                continue
            id_ += 1
            annotation: dict[str, Any] = {
                "id": id_,
                "image_id": labels.index,
                "category_id": category[body.spacecraft],
                "bbox": box,
                "area": body.mask_area_px if body.has("mask_area_px") else box.width * box.height,
                "iscrowd": 0,
            }
            if name is not None:
                annotation["instance"] = name
            if body.has("mask_rle"):
                annotation["segmentation"] = body.mask_rle.model_dump(mode="json")
            if body.has("keypoints"):
                points = [body.keypoints[point] for point in crafts[body.spacecraft].keypoints_body_m]
                annotation["keypoints"] = [
                    x for p in points for x in (p if p.visibility != NOT_IN_FRAME else (0, 0, 0))
                ]
                annotation["num_keypoints"] = sum(p.visibility != NOT_IN_FRAME for p in points)
            yield annotation


def category_record(craft: SpacecraftInfo, id_: int) -> dict[str, Any]:
    """The category of a spacecraft."""
    number = {name: i for i, name in enumerate(craft.keypoints_body_m, 1)}
    return {
        "id": id_,
        "name": craft.name,
        "supercategory": "spacecraft",
        "keypoints": list(number),
        "skeleton": [[number[a], number[b]] for a, b in craft.skeleton],
        "sigmas": [KEYPOINT_SIGMA] * len(number),
    }
