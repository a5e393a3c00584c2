"""Folders of pictures: images to look at, photographs to label, images of SPEED, SPEED+ and SHIRT."""

from __future__ import annotations

import json
import random
from pathlib import Path

import cv2
import numpy as np
from damage import VALUES, damage, damaged_bytes

from inputs.kind import Kind
from inputs.models import write_boxes_model
from posse_core._plugins.loading import load_plugins
from posse_core._simulator.scene import named_craft

SIZE_PX = (64, 48)
NAMES = ("a.png", "b.jpg", "c.tif", "d.bmp", "deep.png", "clear.png")
CAMERA = {
    "Nu": SIZE_PX[0],
    "Nv": SIZE_PX[1],
    "ppx": 1e-5,
    "ppy": 1e-5,
    "fx": 1e-3,
    "fy": 1e-3,
    "distCoeffs": [0.1, 0, 0, 0, 0],
    "cameraMatrix": [[100, 0, 32], [0, 100, 24], [0, 0, 1]],
}


def write_pictures(folder: Path) -> None:
    (folder / "i").mkdir()
    grey = np.arange(SIZE_PX[0] * SIZE_PX[1], dtype=np.uint16).reshape(SIZE_PX[::-1])
    for name in NAMES[:4]:
        cv2.imwrite(str(folder / "i" / name), (grey % 256).astype(np.uint8))
    cv2.imwrite(str(folder / "i" / "deep.png"), grey * 20)
    cv2.imwrite(str(folder / "i" / "clear.png"), np.full((*grey.shape, 4), 90, np.uint8))
    write_boxes_model(folder / "m.onnx")


def pictures(folder: Path, draw: random.Random) -> list[str]:
    for _ in range(draw.choice((1, 1, 3))):
        path = folder / "i" / draw.choice(NAMES)
        if draw.random() < 0.1:
            damage(path, draw)
        elif path.is_file():
            path.write_bytes(damaged_bytes(path.read_bytes(), draw))
    chosen = draw.choice((["i"], ["i"], [f"i/{name}" for name in NAMES]))
    return ["detect", *chosen, "--model", "m.onnx", *draw.choice(([], ["--json"], ["--out", "drawn"]))]


def write_photographs(folder: Path) -> None:
    """Photographs of no spacecraft, with points where its keypoints would be."""
    (folder / "photos").mkdir()
    for name in ("a.png", "b.jpg"):
        cv2.imwrite(str(folder / "photos" / name), np.full(SIZE_PX[::-1], 90, np.uint8))
    (folder / "camera.json").write_text(json.dumps(CAMERA))
    matrix, lens = np.array(CAMERA["cameraMatrix"], float), np.array(CAMERA["distCoeffs"])
    points = named_craft("cubesat", load_plugins().registry).keypoints_body_m
    places = cv2.projectPoints(
        np.array(list(points.values())), np.full(3, 0.4), np.array([0.0, 0.0, 1.5]), matrix, lens
    )[0][:, 0]
    clicked = {name: place.tolist() for name, place in zip(points, places, strict=True)}
    record = {
        "spacecraft": "cubesat",
        "photos": {"a.png": clicked, "b.jpg": dict(list(clicked.items())[:6])},
    }
    (folder / "points.json").write_text(json.dumps(record))


ANNOTATE = ["annotate", "photos", "--target", "cubesat", "--camera", "camera.json", "--sigma-px", "0.01"]


def photographs(folder: Path, draw: random.Random) -> list[str]:
    name = draw.choice(
        ("points.json", "points.json", "points.json", "photos/a.png", "photos/b.jpg", "camera.json")
    )
    damage(folder / name, draw)
    return [*ANNOTATE, *draw.choice(([], ["--points", "points.json"], ["--points", "points.json"]))]


LAYOUTS = {
    "plus/synthetic": "speed+",
    "plus/lightbox": "speed+",
    "first": "speed",
    "shirt/roe1/lightbox": "shirt",
}


def write_speeds(folder: Path) -> None:
    """Labelled images as the three data sets lay them, of a small camera."""
    files = (
        "plus/synthetic/train.json",
        "plus/lightbox/test.json",
        "first/train.json",
        "shirt/roe1/roe1.json",
    )
    images = (
        "plus/synthetic/images",
        "plus/lightbox/images",
        "first/images/train",
        "shirt/roe1/lightbox/images",
    )
    key = {"first/train.json": "q_vbs2tango"}
    for file, home in zip(files, images, strict=True):
        (folder / home).mkdir(parents=True)
        (folder / file).parent.mkdir(exist_ok=True)
        entries = []
        for number in range(1, 4):
            name = f"img{number:06}.png"
            cv2.imwrite(str(folder / home / name), np.full(SIZE_PX[::-1], 40 * number, np.uint8))
            attitude = {key.get(file, "q_vbs2tango_true"): [0.5, 0.5, -0.5, 0.5]}
            entries.append({"filename": name, **attitude, "r_Vo2To_vbs_true": [0.1, 0.0, 5.0 + number]})
        (folder / file).write_text(json.dumps(entries))
    for home in ("plus", "first", "shirt/roe1"):
        (folder / home / "camera.json").write_text(json.dumps(CAMERA))
    write_boxes_model(folder / "m.onnx", "tango")


def speeds(folder: Path, draw: random.Random) -> list[str]:
    home = draw.choice(list(LAYOUTS))
    above = folder / home.split("/lightbox")[0].split("/synthetic")[0]
    files = sorted(path for path in above.rglob("*") if path.is_file())
    files += 6 * [path for path in files if path.suffix == ".json"]
    damage(draw.choice(files), draw)
    command = ["eval", home, "--model", "m.onnx", "--part", "all"]
    if draw.random() < 0.5:
        command += ["--format", LAYOUTS[home]]
    if draw.random() < 0.1:
        command += ["--target", str(draw.choice(VALUES)).replace("\0", "")]
    return command


KINDS = {
    "pictures": Kind(
        write_pictures,
        pictures,
        ("detect i --model m.onnx --out drawn", "detect i --model m.onnx --json"),
    ),
    "photographs": Kind(
        write_photographs,
        photographs,
        (" ".join(ANNOTATE), " ".join([*ANNOTATE, "--points", "points.json"])),
    ),
    "speed": Kind(
        write_speeds,
        speeds,
        tuple(
            f"eval {home} --model m.onnx --part all --format {name}" for home, name in LAYOUTS.items()
        ),
    ),
}
