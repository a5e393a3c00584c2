"""A recipe from end to end: killed wherever it may be, it ends in the same bytes."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_recipe import KEYS, write_recipe

from posse_core._dataset.dataset import Dataset
from posse_core._detection.card import ModelCard
from posse_core._detection.models import shipped_model
from posse_core._evaluation.metrics import seen_bodies
from posse_core._files.atomic import sha256
from posse_core._model.manifest import Manifest
from posse_core._plugins.loading import load_plugins

END = ("recipe.yaml", "card.md", "evaluation.html", "predictions.html", "boxes.onnx", "keypoints.onnx")


@pytest.fixture(scope="module")
def whole(posse_in, guess_path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    done = posse_in(folder, "recipe", write_recipe(folder), env={"PYTHONPATH": guess_path})
    assert done.returncode == 0, done.stderr
    return folder


def labels_of(folder: Path) -> dict[str, bytes]:
    files = sorted((folder / "data").glob("labels/*")) + sorted((folder / "data").glob("partition/*"))
    assert files
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_everything_is_there(whole: Path) -> None:
    for name in END:
        assert (whole / name).stat().st_size > 0, name
    frames = json.loads((whole / "decision.json").read_text())["frames"]
    assert frames == {"plain": 7, "noisy": 4, "empty": 3}
    dataset = Dataset(whole / "data")
    kept = {name: [x for x in dataset if x.origin[0] == name] for name in frames}
    # The rule drops the frames that show few keypoints, but never those without a spacecraft.
    assert len(kept["empty"]) == frames["empty"]
    assert all(not seen_bodies(labels) for labels in kept["empty"])
    assert all(seen_bodies(labels) for name in ("plain", "noisy") for labels in kept[name])
    card = (whole / "card.md").read_text()
    assert dataset.sha256 in card
    assert "| empty | flat | no |" in card


def test_repeated_it_does_nothing(whole: Path, posse_in, guess_path) -> None:
    def times() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in whole.rglob("*.*") if path.name != "card.md"}

    before = times()
    done = posse_in(whole, "recipe", "recipe.yaml", env={"PYTHONPATH": guess_path})
    assert done.returncode == 0, done.stderr
    assert times() == before


@pytest.mark.slow
def test_killed_in_each_step_it_ends_in_the_same_bytes(
    whole: Path, start_posse_in, posse_in, guess_path, tmp_path: Path
) -> None:
    """Killed as soon as each of these is there, and repeated."""
    recipe = write_recipe(tmp_path)
    env = {"PYTHONPATH": guess_path}
    for mark in (
        "craft/spacecraft.yaml",
        "runs/plain/images/*.png",
        "runs/noisy/images/*.png",
        "data/manifest.json",
        "boxes/last.json",
        "keypoints/model.safetensors",
    ):
        with start_posse_in(tmp_path, "recipe", recipe, env=env) as process:
            until = time.monotonic() + 100
            while not any(tmp_path.glob(mark)) and process.poll() is None:
                assert time.monotonic() < until
                time.sleep(0.005)
            process.kill()
            process.wait()
        assert any(tmp_path.glob(mark)), f"{mark}: {process.returncode}"
    done = posse_in(tmp_path, "recipe", recipe, env=env)
    assert done.returncode == 0, done.stderr
    assert labels_of(tmp_path) == labels_of(whole)
    assert Dataset(tmp_path / "data").sha256 == Dataset(whole / "data").sha256
    for name in ("boxes", "keypoints"):
        model = f"{name}/model.safetensors"
        assert (tmp_path / model).read_bytes() == (whole / model).read_bytes()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": 4}, ["decision.json: was made with seed 3, which is now 4; remove it"]),
        ({"boxes": {**KEYS["boxes"], "epochs": 5}}, ["decision.json", "boxes.epochs 3, which is now 5"]),
        ({"craft": {**KEYS["craft"], "scale_m_per_unit": 2.0}}, ["craft", "scale_m_per_unit 1.0"]),
    ],
)
def test_a_changed_recipe_is_not_mixed_with_what_is_there(
    whole: Path, posse_in, guess_path, changes: dict[str, Any], words: list[str]
) -> None:
    kept = (whole / "recipe.yaml").read_text()
    try:
        write_recipe(whole, **changes)
        done = posse_in(whole, "recipe", "recipe.yaml", env={"PYTHONPATH": guess_path})
    finally:
        (whole / "recipe.yaml").write_text(kept)
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr


def test_what_was_decided_by_the_time_is_kept(posse_in, guess_path, tmp_path: Path) -> None:
    """The probe measures this machine as it is now, so a repeated call must not decide anew."""
    env = {"PYTHONPATH": guess_path}
    data = {**KEYS["data"], "frames": None}
    nets = {task: {"name": f"guess-{task}"} for task in ("boxes", "keypoints")}
    recipe = write_recipe(tmp_path, hours=0.0001, data=data, **nets)
    done = posse_in(tmp_path, "recipe", recipe, env=env)
    assert done.returncode == 0, done.stderr
    assert "longer than 0.0001 h" in done.stdout
    decided = json.loads((tmp_path / "decision.json").read_text())
    assert set(decided["expected_s"]) == {"frames", "boxes", "keypoints", "evaluation"}
    assert not (tmp_path / ".probe").exists()
    assert sum(decided["frames"].values()) == Manifest.from_json(
        (tmp_path / "data" / "manifest.json").read_bytes()
    ).frames + sum(rule.dropped for rule in Dataset(tmp_path / "data").manifest.selection or ())
    (tmp_path / "evaluation.json").unlink()
    again = posse_in(tmp_path, "recipe", recipe, env=env)
    assert again.returncode == 0, again.stderr
    assert json.loads((tmp_path / "decision.json").read_text()) == decided
    assert (tmp_path / "evaluation.json").exists()


@pytest.mark.slow
def test_real_nets_learn_from_real_frames(posse_in, tmp_path: Path) -> None:
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    pytest.importorskip("posse_detect_torch", reason="the torch plugin is not installed")
    scenario = {**KEYS["data"]["scenario"], "renderer": "raster"}
    recipe = write_recipe(
        tmp_path,
        data={**KEYS["data"], "scenario": scenario},
        boxes={"name": "nano", "input_px": 64, "batch": 4, "epochs": 1},
        keypoints={"name": "heatmap", "input_px": 64, "batch": 4, "epochs": 1},
        refiner={"name": "render-compare", "size_px": 64},
        start="aqua",
    )
    done = posse_in(tmp_path, "recipe", recipe)
    assert done.returncode == 0, done.stderr
    for task in ("boxes", "keypoints"):
        card = ModelCard.read(tmp_path / task / "model.safetensors")
        assert card.dataset_sha256 == Dataset(tmp_path / "data").sha256
        shipped = shipped_model(task, ["aqua"], load_plugins().registry)
        assert card.options["start"] == f"{task}.onnx, SHA-256 {sha256(shipped)}"
        assert card.options["start"] in (tmp_path / "card.md").read_text()
    proven = posse_in(tmp_path, "validate", "data")
    assert proven.returncode == 0, proven.stdout
    (tmp_path / "some").mkdir()
    for image in sorted((tmp_path / "data" / "images").iterdir())[:2]:
        shutil.copy(image, tmp_path / "some")
    found = posse_in(
        tmp_path, "detect", "some", "--model", "boxes.onnx", "--keypoints", "keypoints.onnx",
        "--camera", "data/camera.json", "--target", "craft", "--refine", "--refine-ms", 500, "--json",
    )  # fmt: skip
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start": "kite"}, ["start: no shipped model finds kite", "or set it to null"]),
        (
            {"start": "aqua", "boxes": {"name": "sdn", "input_px": 64, "epochs": 1}},
            ["boxes.onnx: none of its tensors fits", "or set start to null in the recipe"],
        ),
    ],
)
def test_a_start_that_does_not_fit_is_told_with_the_way_out(
    posse_in, tmp_path: Path, changes: dict[str, Any], words: list[str]
) -> None:
    pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")
    pytest.importorskip("posse_detect_torch", reason="the torch plugin is not installed")
    scenario = {**KEYS["data"]["scenario"], "renderer": "raster"}
    nets = {
        "boxes": {"name": "nano", "input_px": 64, "epochs": 1},
        "keypoints": {"name": "heatmap", "input_px": 64, "epochs": 1},
    }
    keys = {"data": {**KEYS["data"], "scenario": scenario}, **nets, **changes}
    done = posse_in(tmp_path, "recipe", write_recipe(tmp_path, **keys))
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr


def test_a_command_makes_the_recipe_and_goes_on_with_it(posse_in, guess_path, tmp_path: Path) -> None:
    """With the nets that are installed; the first step that cannot be done ends it, and the recipe is
    there to be changed."""
    env = {"PYTHONPATH": guess_path}
    write_recipe(tmp_path)
    done = posse_in(tmp_path, "recipe", "box.obj", "--out", "r", env=env)
    assert done.returncode == 2
    assert "unit of the mesh is not given" in done.stderr
    assert not (tmp_path / "r").exists()
    recipe = write_recipe(tmp_path / "r")
    written = yaml.safe_load(recipe.read_text())
    other = posse_in(tmp_path, "recipe", "box.obj", "--scale", 2, "--out", "r", env=env)
    assert other.returncode == 2
    assert "another craft" in other.stderr
    assert yaml.safe_load(recipe.read_text()) == written
