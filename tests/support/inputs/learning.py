"""What nets learn from, and what is done with them: ``posse train``, ``export-onnx`` and ``adapt``."""

from __future__ import annotations

import random
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from command import run_posse
from damage import damage, damaged_value
from small_flight import NATURAL
from small_recipe import KEYS

from inputs.kind import Kind
from posse_core import Dataset, ModelCard

SIDE_PX = 64
TRAIN = ["train", "r/data", "--detector", "nano", "--out", "t"]
TRAIN += ["-o", "epochs=1", "-o", f"input_px={SIDE_PX}"]
EXPORT = ["export-onnx", "r/boxes/model.safetensors", "--dataset", "r/data", "--out", "m.onnx"]
ADAPT = ["adapt", "r", "images", "--out", "a", "--epochs", "1"]
CAMERA = ["--camera", "r/data/camera.json"]


def write_learning(folder: Path) -> None:
    """The folder of a recipe that was followed, with nets that know nothing, and photographs."""
    torch = pytest.importorskip("torch")
    from posse_detect_torch.checkpoint import write_model
    from posse_detect_torch.heatmap import HeatMaps
    from posse_detect_torch.nano import Nano

    torch.set_num_threads(1)
    torch.manual_seed(0)  # of some weights, two peaks are so alike that rounding tells them
    motion = NATURAL.replace("name: flat, seconds: 0", "name: raster").replace("count: 60", "count: 6")
    (folder / "natural.yaml").write_text(motion)
    home = folder / "r"
    for command in (
        ("run", folder / "natural.yaml", "--out", home / "data"),
        ("partition", home / "data", "--split", "34/33/33"),
    ):
        code, _, error = run_posse(*command)
        assert code == 0, error
    options = {"epochs": 1, "input_px": SIDE_PX}
    nets = {
        "boxes": {"name": "nano", **options},
        "keypoints": {"name": "heatmap", "size": "nano", **options},
    }
    data = {**KEYS["data"], "scenario": {**KEYS["data"]["scenario"], "renderer": "raster"}}
    keys = {**KEYS, "craft": {"name": "aqua"}, "data": data, **nets}
    (home / "recipe.yaml").write_text(yaml.safe_dump(keys))
    dataset = Dataset(home / "data")
    points = len(dataset.spacecraft.keypoints_body_m)
    for task, net, name in (
        ("boxes", Nano(1), "nano"),
        ("keypoints", HeatMaps(points, "nano"), "heatmap"),
    ):
        (home / task).mkdir()
        card = ModelCard.of_dataset(
            dataset, net=name, task=task, input_px=SIDE_PX, version="0", options={"size": "nano"}
        )
        write_model(home / task / "model.safetensors", net.state_dict(), card)
    (folder / "images").mkdir()
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(folder / "images" / name), np.full((120, 160), 90, np.uint8))


def learning(folder: Path, draw: random.Random) -> list[str]:
    command = draw.choice((TRAIN, EXPORT, ADAPT, [*ADAPT, *CAMERA]))
    home = folder / "r"
    files = [path for path in sorted(home.rglob("*")) if path.is_file()]
    if command[0] == "adapt":
        files += [folder / "images" / "a.png", *(12 * [home / "recipe.yaml"])]
    files += [*home.glob("*/model.safetensors"), *home.glob("*/labels/*"), *home.glob("*/*.json")] * 3
    path = draw.choice(files)
    if path.name == "recipe.yaml" and draw.random() < 0.8:
        path.write_text(yaml.safe_dump(damaged_value(yaml.safe_load(path.read_text()), draw)))
    else:
        damage(path, draw)
    return command


KINDS = {
    "learning": Kind(
        write_learning,
        learning,
        tuple(" ".join(command) for command in (TRAIN, EXPORT, [*ADAPT, *CAMERA])),
        keeps=("a",),
    )
}
