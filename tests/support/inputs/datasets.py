"""Datasets of POSSE, and labels in other formats, as any program may have written them."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import cuboid
import cuboid_sensors
from command import run_posse
from damage import damage, damaged_text
from small_flight import NATURAL
from small_flight import SCENARIO as FLIGHT

from inputs.kind import Kind
from inputs.models import write_boxes_model


def write_dataset(folder: Path) -> None:
    cuboid_sensors.add_readings(cuboid.write_dataset(folder / "s"))
    cuboid.add_twin(cuboid.write_dataset(folder / "d"))
    code, _, error = run_posse("partition", folder / "d")
    assert code == 0, error
    for form in ("coco", "speed"):
        code, _, error = run_posse("export", folder / "d", "--format", form)
        assert code == 0, error
    write_boxes_model(folder / "m.onnx")


EXPORTS = ("bop", "coco", "colmap", "hf", "nerfstudio", "posse", "speed", "yolo")


def dataset(folder: Path, draw: random.Random) -> list[str]:
    if draw.random() < 0.2:
        files = sorted(path for path in (folder / "s" / "sensors").rglob("*") if path.is_file())
        damage(draw.choice(files), draw)
        return draw.choice(
            (["validate", "s"], ["view", "s", "--out", "v.html"], ["collect", "s", "--out", "c"])
        )
    files = sorted(path for path in (folder / "d").rglob("*") if path.is_file())
    groups: dict[str, list[Path]] = {}
    for path in files:
        groups.setdefault(f"{path.parent.name}{path.suffix}", []).append(path)
    path = draw.choice(groups[draw.choice(sorted(groups))])
    if draw.random() < 0.1:
        name = draw.choice(("labels/shard-00009.jsonl", "spacecraft/other.json", "images/x.png"))
        path = folder / "d" / name
        path.write_text("{}\n")
    damage(path, draw)
    commands = [["validate", "d"], ["view", "d", "--out", "v.html"], ["partition", "d"]]
    commands += [
        ["collect", "d", "--out", "c"],
        ["detect", str(path.relative_to(folder)), "--model", "m.onnx"],
    ]
    commands += [["export", "d", "--out", "e", "--format", form] for form in EXPORTS]
    commands += [["eval", "d", "--model", "m.onnx", "--part", draw.choice(("all", "test"))]]
    return draw.choice(commands)


def write_foreign(folder: Path) -> None:
    write_dataset(folder)
    for form in ("bop", "yolo"):
        code, _, error = run_posse("export", folder / "d", "--format", form)
        assert code == 0, error


def foreign(folder: Path, draw: random.Random) -> list[str]:
    """Labels in other formats, as any program may have written them."""
    home = folder / "d"
    file, name = draw.choice(
        (
            ("coco.json", "coco.json"),
            ("speed.json", "speed.json"),
            ("bop/models/models_info.json", "bop"),
            ("bop/train/000000/scene_gt.json", "bop"),
            ("bop/train/000000/scene_camera.json", "bop"),
            ("bop/models/obj_000001.ply", "bop"),
            ("bop/train/000000/depth/000000.png", "bop"),
            ("yolo/data.yaml", "yolo"),
            ("yolo/train.txt", "yolo"),
            ("yolo/labels/000001.txt", "yolo"),
        )
    )
    if not (home / file).is_file():
        file = file.replace("train", "val")
    if file.endswith(".txt"):
        (home / file).write_text(damaged_text((home / file).read_text(), draw))
    elif (home / file).is_file():
        damage(home / file, draw)
    if name == "coco.json" and draw.random() < 0.5:
        return ["eval", "d/coco.json", "--model", "m.onnx", "--part", "all"]
    return ["validate", f"d/{name}"]


MOTION = NATURAL.replace("name: flat, seconds: 0", "name: raster")


def write_flown(folder: Path) -> None:
    """A natural motion that was tracked, and a flight."""
    (folder / "natural.yaml").write_text(MOTION.replace("count: 60", "count: 5"))
    (folder / "flight.yaml").write_text(FLIGHT.replace("name: flat, seconds: 0", "name: raster"))
    for command in (
        "run natural.yaml --out d",
        "track d -o measurement.source=truth",
        "fly flight.yaml --out f",
    ):
        posse = Path(sys.executable).with_name("posse")
        subprocess.run([posse, *command.split()], cwd=folder, check=True, capture_output=True)


TRACK = ["track", "d", "-o", "measurement.source=truth"]


def flown(folder: Path, draw: random.Random) -> list[str]:
    """What a run or a flight goes on with, is tracked over, or is looked at."""
    home = draw.choice(("d", "f"))
    groups: dict[str, list[Path]] = {}
    for path in sorted(path for path in (folder / home).rglob("*") if path.is_file()):
        groups.setdefault(f"{path.parent.name}{path.suffix}", []).append(path)
    damage(draw.choice(groups[draw.choice(sorted(groups))]), draw)
    commands = [["view", home, "--out", "v.html"], ["validate", home]]
    if home == "d":
        commands += [[*TRACK, "--out", "t"], ["run", "--resume", "--out", "d"]]
    else:
        commands += [["fly", "--resume", "--out", "f"], ["track", "f", "--out", "t"]]
    return draw.choice(commands)


KINDS = {
    "dataset": Kind(
        write_dataset,
        dataset,
        (
            *("validate d", "view d --out v.html", "partition d", "collect d --out c"),
            *("view s --out v.html", "collect s --out c"),
            *("detect d/images/000000.png --model m.onnx", "eval d --model m.onnx --part all"),
            *(f"export d --out e --format {form}" for form in EXPORTS),
        ),
    ),
    "foreign": Kind(
        write_foreign,
        foreign,
        (
            *(f"validate d/{name}" for name in ("coco.json", "speed.json", "bop", "yolo")),
            "eval d/coco.json --model m.onnx --part all",
        ),
    ),
    "flown": Kind(
        write_flown,
        flown,
        (
            *("view d --out v.html", "validate d", " ".join(TRACK) + " --out t", "run --resume --out d"),
            *("view f --out v.html", "validate f", "track f --out t", "fly --resume --out f"),
        ),
    ),
}
