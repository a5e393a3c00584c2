"""COCO: boxes, segmentation and keypoints in one ``coco.json`` (Lin et al. 2014, and cocodataset.org).

A keypoint that is outside the image is unlabelled in COCO's sense: 0, 0, 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from posse_core import __version__
from posse_core._dataset.dataset import Dataset, SpacecraftInfo, read_json
from posse_core._files.text import text_file, write_items
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._model.labels import NOT_IN_FRAME

KEYPOINT_SIGMA = 0.025
"""Of the object keypoint similarity, for every keypoint: that of COCO's best placed one, the eye."""

NEEDS = {"box_visible_px": "box"}


class CocoWriter(Writer):
    """Writes ``coco.json``; pycocotools loads it as it is.

    An image's id is its frame's index. A frame in which nothing of the craft is seen has an image and
    no annotation. Without the annotators ``mask`` and ``keypoints`` those members are left out, and
    the area is the box's.
    """

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write ``coco.json``."""
        path = folder / "coco.json"
        category = {name: i for i, name in enumerate(sorted(dataset.spacecraft_by_name), 1)}
        with text_file(path) as text:
            text.write('{"info": ')
            text.write(f'{{"description": "POSSE dataset", "version": "{__version__}"}},\n"images": ')
            write_items(text, _images(dataset))
            text.write(',\n"annotations": ')
            write_items(text, _annotations(dataset, category))
            text.write(',\n"categories": ')
            crafts = dataset.spacecraft_by_name
            write_items(text, (_category(crafts[name], id_) for name, id_ in category.items()))
            text.write("}\n")
        return [path]


def _images(dataset: Dataset) -> Iterator[dict[str, Any]]:
    for labels in dataset.frames:
        yield {
            "id": labels["index"],
            "file_name": labels["image"],
            "width": dataset.camera.width_px,
            "height": dataset.camera.height_px,
        }


def _annotations(dataset: Dataset, category: dict[str, int]) -> Iterator[dict[str, Any]]:
    id_ = 0
    for labels in labels_with(dataset, "COCO", NEEDS):
        box = labels["box_visible_px"]
        if box is None:
            continue
        id_ += 1
        craft = dataset.spacecraft_by_name[labels["spacecraft"]]
        annotation: dict[str, Any] = {
            "id": id_,
            "image_id": labels["index"],
            "category_id": category[craft.name],
            "bbox": box,
            "area": labels.get("mask_area_px", box[2] * box[3]),
            "iscrowd": 0,
        }
        if "mask_rle" in labels:
            annotation["segmentation"] = labels["mask_rle"]
        if "keypoints" in labels:
            points = [labels["keypoints"][name] for name in craft.keypoints_body_m]
            annotation["keypoints"] = [
                x for p in points for x in (p if p[2] != NOT_IN_FRAME else (0, 0, 0))
            ]
            annotation["num_keypoints"] = sum(p[2] != NOT_IN_FRAME for p in points)
        yield annotation


def _category(craft: SpacecraftInfo, id_: int) -> dict[str, Any]:
    place = {name: i for i, name in enumerate(craft.keypoints_body_m, 1)}
    return {
        "id": id_,
        "name": craft.name,
        "supercategory": "spacecraft",
        "keypoints": list(place),
        "skeleton": [[place[a], place[b]] for a, b in craft.skeleton],
        "sigmas": [KEYPOINT_SIGMA] * len(place),
    }


def read_coco(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Image name and labels of every image in a COCO file, the labels as a dataset's lines have them.

    An image without an annotation has the box null. Keypoints outside the image are left out.
    """
    return ((image["file_name"], labels) for image, labels in coco_entries(read_json(path)))


def coco_entries(value: Mapping[str, Any]) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
    """The ``images`` entry and the labels of every image, as :func:`read_coco` tells them.

    Raises:
        ValueError: an image has several annotations, where a label line is of one craft.
    """
    categories = {category["id"]: category for category in value["categories"]}
    annotation_of = {annotation["image_id"]: annotation for annotation in value["annotations"]}
    if len(annotation_of) < len(value["annotations"]):
        raise ValueError("an image has several annotations, where one craft an image can be told")
    for image in value["images"]:
        labels: dict[str, Any] = {"box_visible_px": None}
        annotation = annotation_of.get(image["id"])
        if annotation is not None:
            category = categories[annotation["category_id"]]
            labels = {"spacecraft": category["name"], "box_visible_px": annotation["bbox"]}
            if isinstance(annotation.get("segmentation"), dict):
                labels |= {"mask_rle": annotation["segmentation"], "mask_area_px": annotation["area"]}
            if "keypoints" in annotation:
                flat = iter(annotation["keypoints"])
                points = zip(category["keypoints"], zip(flat, flat, flat, strict=True), strict=True)
                labels["keypoints"] = {name: list(p) for name, p in points if p[2] != NOT_IN_FRAME}
        yield image, labels
