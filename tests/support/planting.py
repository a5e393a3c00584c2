"""Faults planted into a dataset as by a program that writes it wrong: its checksums are right."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

Plant = Callable[[Path], None]
Image = np.ndarray


def seal(folder: Path) -> None:
    """Sign every file as it is now."""

    def digest(name: str) -> str:
        return hashlib.sha256((folder / name).read_bytes()).hexdigest()

    sums = folder / "checksums.sha256"
    names = [row.partition("  ")[2] for row in sums.read_text().splitlines() if not row.startswith("#")]
    sums.write_text("".join(f"{digest(name)}  {name}\n" for name in names))
    manifest = json.loads((folder / "manifest.json").read_text())
    for part in ("sha256", "exports"):
        manifest[part] = {name: digest(name) for name in manifest[part]}
    (folder / "manifest.json").write_text(json.dumps(manifest))


def write(path: Path, data: bytes) -> None:
    """Write a file anew: pictures are hard links in exports."""
    path.unlink(missing_ok=True)
    path.write_bytes(data)


def picture(index: int, alter: Callable[[Image], Image], folder_name: str = "images") -> Plant:
    def plant(folder: Path) -> None:
        path = folder / folder_name / f"{index:06d}.png"
        image = alter(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
        write(path, cv2.imencode(".png", image)[1].tobytes())

    return plant


def pictures(alter: Callable[[Image], Image], count: int) -> Plant:
    def plant(folder: Path) -> None:
        for index in range(count):
            picture(index, alter)(folder)

    return plant


def other_picture(index: int, other: int, where: str = "images") -> Plant:
    def plant(folder: Path) -> None:
        write(folder / where / f"{index:06d}.png", (folder / where / f"{other:06d}.png").read_bytes())

    return plant


def arrays(index: int, alter: Callable[[dict[str, np.ndarray]], None]) -> Plant:
    def plant(folder: Path) -> None:
        path = folder / f"truth/{index:06d}.npz"
        with np.load(path) as file:
            values = dict(file)
        alter(values)
        np.savez_compressed(path, **values)

    return plant


def lines(alter: Callable[[list[dict[str, Any]]], None]) -> Plant:
    def plant(folder: Path) -> None:
        path = next(folder.glob("labels/*.jsonl"))
        values = [json.loads(line) for line in path.read_text().splitlines()]
        alter(values)
        path.write_text("".join(json.dumps(value) + "\n" for value in values))

    return plant


def line(index: int, **values: Any) -> Plant:
    """Other labels of a frame; a function is given the old value."""

    def alter(every: list[dict[str, Any]]) -> None:
        for key, value in values.items():
            every[index][key] = value(every[index][key]) if callable(value) else value

    return lines(alter)


def data(name: str, alter: Callable[[Any], None]) -> Plant:
    """A change in a JSON or YAML file."""

    def plant(folder: Path) -> None:
        path = folder / name
        text = path.read_text()
        value = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
        alter(value)
        path.write_text(json.dumps(value) if path.suffix == ".json" else yaml.safe_dump(value))

    return plant


def text(name: str, alter: Callable[[str], str]) -> Plant:
    def plant(folder: Path) -> None:
        (folder / name).write_text(alter((folder / name).read_text()))

    return plant


def motion(**values: Callable[[np.ndarray], np.ndarray]) -> Plant:
    def plant(folder: Path) -> None:
        with np.load(folder / "trajectory.npz") as file:
            known = dict(file)
        for key, alter in values.items():
            known[key] = alter(known[key])
        np.savez(folder / "trajectory.npz", **known)

    return plant


def swapped(name: str, other: str) -> Plant:
    """The content of two files exchanged."""

    def plant(folder: Path) -> None:
        one, two = (folder / name).read_bytes(), (folder / other).read_bytes()
        write(folder / name, two)
        write(folder / other, one)

    return plant


def both(*plants: Plant) -> Plant:
    def plant(folder: Path) -> None:
        for each in plants:
            each(folder)

    return plant
