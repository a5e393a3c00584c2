"""The core's writers under the conformance kit, each read back by a reader of its format."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pycolmap
import pytest

from posse_core._formats.bop import read_bop
from posse_core._formats.speed import read_speed
from posse_core._formats.yolo import read_yolo
from posse_core._model.camera import Camera
from posse_core._plugins.loading import Plugins
from posse_core.testing import WriterConformance

REGISTRY = Plugins([]).registry
CAMERA = Camera(96, 72, 100.0, 100.0, 47.5, 35.5, 0.036)


def of_colmap(folder: Path) -> list[str]:
    (model,) = (path.parent for path in folder.rglob("images.txt"))
    names = (image.name for image in pycolmap.Reconstruction(model).images.values())
    return [f"images/{Path(name).name}" for name in names]


def of_nerfstudio(folder: Path) -> list[str]:
    (path,) = folder.rglob("transforms.json")
    frames = json.loads(path.read_text())["frames"]
    return [f"images/{Path(frame['file_path']).name}" for frame in frames]


READERS = {
    "bop": lambda folder: [image.image for image in read_bop(folder / "bop")],
    "coco": lambda folder: [
        image["file_name"] for image in json.loads((folder / "coco.json").read_text())["images"]
    ],
    "colmap": of_colmap,
    "hf": lambda folder: [
        f"images/{json.loads(line)['file_name']}"
        for path in folder.glob("hf/*/metadata.jsonl")
        for line in path.read_text().splitlines()
    ],
    "nerfstudio": of_nerfstudio,
    "posse": lambda folder: [
        row["filename"]
        for row in csv.DictReader((folder / "posse" / "dataset.csv").read_text().splitlines())
    ],
    "speed": lambda folder: [pose.image for pose in read_speed(folder / "speed.json")],
    "yolo": lambda folder: [image.image for image in read_yolo(folder / "yolo", CAMERA)],
}


@pytest.fixture(params=REGISTRY.names("writer"), autouse=True, scope="class")
def name(request):
    request.cls.name = request.param
    request.cls.capabilities = REGISTRY.spec("writer", request.param).capabilities


class TestWriters(WriterConformance):
    name = "coco"

    def writer(self):
        return REGISTRY.create("writer", self.name)

    def images_in(self, folder):
        return READERS[self.name](folder) if self.name in READERS else None
