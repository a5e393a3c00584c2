"""A dataset of two cuboids drawn by hand (``tests/support/cuboid.py``), divided into parts."""

from __future__ import annotations

from pathlib import Path

import command
import cuboid
import cv2
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from posse_core import Dataset

HALVES = cuboid.HALF, np.array([1.4, 1.4, 0.1])


@pytest.fixture(autouse=True, scope="session")
def _one_thread():
    torch.set_num_threads(1)


def write_dataset(
    folder: Path, frames: int, seed: int = 5, names: tuple[str, str] = ("brick", "plate")
) -> Path:
    """Frames of two crafts in turn, each face of another grey, before a dim sky."""
    random = np.random.default_rng(seed)
    halves = dict(zip(names, HALVES, strict=True))
    crafts = {name: cuboid.cuboid(name, half) for name, half in halves.items()}
    cuboid.start_dataset(folder, crafts.values())
    lines = []
    for index in range(frames):
        name = names[index % 2]
        axis = random.normal(size=3)
        turn = random.uniform(0, 0.8) * axis / np.linalg.norm(axis)
        t = np.array([*random.uniform(-0.25, 0.25, 2), 1.0]) * random.uniform(6, 14)
        R = Rotation.from_rotvec(turn).as_matrix()
        labels, arrays = cuboid.labels_of(index, R, t, crafts[name], halves[name], sequence=index)
        side = arrays["part_id"]
        light = np.where(side >= 0, 35 * side + 60, 8) + random.normal(0, 3, side.shape)
        labels["truth"] = None
        cv2.imwrite(str(folder / labels["image"]), np.clip(light, 0, 255).astype(np.uint8))
        lines.append(labels)
    (folder / "trajectory.npz").write_bytes(b"")
    cuboid.write_lines(folder, lines)
    code, _, error = command.run_posse("partition", folder)
    assert code == 0, error
    return folder


@pytest.fixture(scope="session")
def make_dataset():
    return write_dataset


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return Dataset(write_dataset(tmp_path_factory.mktemp("cuboids") / "d", 160))


@pytest.fixture(scope="session")
def posse():
    """Run a command in this process: posse("eval", ...) → exit code, output, errors."""
    return command.run_posse
