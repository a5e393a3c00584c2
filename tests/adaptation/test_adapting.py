"""The command from end to end, with nets that guess the mean of what they learn from."""

from __future__ import annotations

import json
import shutil
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run_posse
from small_recipe import write_recipe

from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.metrics import true_boxes
from posse_core._selection.partition import write_partition

MODELS = ("boxes/model.safetensors", "keypoints/model.safetensors", "boxes.onnx", "keypoints.onnx")


@pytest.fixture(scope="module")
def env(guess_path: str) -> dict[str, str]:
    return {"PYTHONPATH": guess_path}


@pytest.fixture(scope="module")
def nets(posse_in, env, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recipe that was followed to its end."""
    folder = tmp_path_factory.mktemp("nets")
    done = posse_in(folder, "recipe", write_recipe(folder), env=env)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def labelled(nets: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Labelled images of the same spacecraft, half of them for the test."""
    folder = tmp_path_factory.mktemp("target") / "d"
    shutil.copytree(nets / "runs" / "plain", folder)
    write_partition(Dataset(folder), (50, 0, 50), 1, "frame")
    return folder


@pytest.fixture(scope="module")
def adapted(nets: Path, labelled: Path, posse_in, env, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("out") / "a"
    done = posse_in(folder.parent, *command(nets, labelled, folder), env=env)
    assert done.returncode == 0, done.stderr
    assert "held out, before" in done.stdout
    return folder


def command(nets: Path, labelled: Path, out: Path) -> list[object]:
    return ["adapt", nets, labelled, "--out", out, "--share", 0.5]


def mean_of(model: Path) -> np.ndarray:
    """What the guessing net has learned: the mean box."""
    data = model.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    return np.array(json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["mean"]))


def boxes_of(dataset: Dataset) -> list[np.ndarray]:
    positions = dataset.part("train")
    return [box.box_px for i in positions for box in true_boxes(dataset[i])]


def test_the_nets_learn_from_the_labels_as_they_are_beside_the_recipes_own(
    nets: Path, labelled: Path, adapted: Path
) -> None:
    own, target = Dataset(nets / "data"), Dataset(labelled)
    count, learned = len(own.part("train")), target.part("train")
    # Half of what is learned from: as many as the recipe's own, repeated in turn.
    repeats = [
        len([k for k in range(count) if k * len(learned) // count == i]) for i in range(len(learned))
    ]
    theirs = [
        box.box_px
        for i, times in zip(learned, repeats, strict=True)
        for box in true_boxes(target[i])
        for _ in range(times)
    ]
    wanted = np.mean([*boxes_of(own), *theirs], axis=0)
    np.testing.assert_allclose(mean_of(adapted / "boxes/model.safetensors"), wanted)
    assert not np.allclose(mean_of(nets / "boxes/model.safetensors"), wanted)
    figures = json.loads((adapted / "adaptation.json").read_text())
    assert figures["learned"] == len(learned)
    assert [(each["name"], each["frames"]) for each in figures["compared"]] == [
        ("held out", len(target.part("test"))),
        ("the recipe's test part", len(own.part("test"))),
    ]


def test_repeated_it_does_nothing_and_something_else_is_refused(
    nets: Path, labelled: Path, adapted: Path, posse_in, env
) -> None:
    def times() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in adapted.rglob("*.*")}

    before = times()
    done = posse_in(adapted, *command(nets, labelled, adapted), env=env)
    assert done.returncode == 0, done.stderr
    assert "held out, after" in done.stdout
    assert times() == before
    other = posse_in(adapted, "adapt", nets, labelled, "--out", adapted, "--share", 0.1, env=env)
    assert other.returncode == 2
    assert f"{adapted / 'boxes'}: was made with dataset" in other.stderr
    assert len(other.stderr.strip().splitlines()) == 1
    assert times() == before


@pytest.mark.slow
def test_killed_in_each_step_it_ends_in_the_same_bytes(
    nets: Path, labelled: Path, adapted: Path, start_posse_in, posse_in, env, tmp_path: Path
) -> None:
    out = tmp_path / "a"
    for mark in ("boxes/last.json", "keypoints/last.json", "boxes.onnx"):
        with start_posse_in(tmp_path, *command(nets, labelled, out), env=env) as process:
            until = time.monotonic() + 100
            while not (out / mark).exists() and process.poll() is None:
                assert time.monotonic() < until
                time.sleep(0.005)
            process.kill()
            process.wait()
        assert (out / mark).exists()
    done = posse_in(tmp_path, *command(nets, labelled, out), env=env)
    assert done.returncode == 0, done.stderr
    for name in (*MODELS, "adaptation.json"):
        assert (out / name).read_bytes() == (adapted / name).read_bytes(), name


def test_photographs_are_learned_from_where_the_nets_trust_their_pose(
    nets: Path, posse_in, env, tmp_path: Path
) -> None:
    shutil.copytree(nets / "runs" / "noisy" / "images", tmp_path / "photos")
    camera = nets / "data" / "camera.json"
    words = ["adapt", nets, tmp_path / "photos", "--camera", camera]
    none = posse_in(tmp_path, *words, "--out", "b", "--trust", 0.99, env=env)
    assert none.returncode == 2
    assert "--trust 0.99: no pose in 4 photographs is trusted" in none.stderr
    assert len(none.stderr.strip().splitlines()) == 1
    # The guesses are poor, so all are taken; what was found before is not sought again.
    seen = {path: path.stat().st_mtime_ns for path in (tmp_path / "b" / "before").iterdir()}
    done = posse_in(tmp_path, *words, "--out", "b", "--trust", 0, "--epochs", 1, env=env)
    assert done.returncode == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "b" / "before").iterdir()} == seen
    assert "poses are trusted in 4 of 4 photographs before" in done.stdout
    assert "no proof" in done.stdout
    assert len(list((tmp_path / "b" / "trusted" / "images").iterdir())) == 4
    for name in (*MODELS, "adaptation.json"):
        assert (tmp_path / "b" / name).stat().st_size > 0


def without(nets: Path, name: str, folder: Path) -> Path:
    """A copy of a recipe's folder that lacks a file."""
    shutil.copytree(nets, folder, ignore=shutil.ignore_patterns("runs", "images"))
    (folder / name).unlink()
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "d"], "nowhere: holds no recipe.yaml; give the folder of 'posse recipe'"),
        (["unfinished", "d"], "model.safetensors: is not there; end the recipe by 'posse recipe"),
        (
            ["nets", "d", "--camera", "speed-plus", "--format", "coco"],
            "--format: is for labelled images",
        ),
        (["nets", "d", "--out", "nets"], "--out nets: is a file, or the folder of a recipe"),
        (["nets", "d", "--out", "d"], "--out d: is there and not of 'posse adapt'"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    nets: Path, labelled: Path, tmp_path: Path, monkeypatch, arguments: list[Any], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nets").symlink_to(nets)
    (tmp_path / "d").symlink_to(labelled)
    if "unfinished" in arguments:
        without(nets, MODELS[1], tmp_path / "unfinished")
    out = [] if "--out" in arguments else ["--out", "out"]
    code, _, error = run_posse("adapt", *arguments, *out)
    assert code == 2, error
    assert words in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
