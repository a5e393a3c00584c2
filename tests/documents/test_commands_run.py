"""The commands of README and documentation, run in small: fewer frames, pixels and epochs, or shorter.

Those of a page run one after another in a folder that has what the page takes for granted.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from command import run_posse
from documents import PAGES, commands, shell

import posse_core

SMALL_CAMERA = ("-o", "camera.width_px=160", "-o", "camera.height_px=120")
GOAL = "{waypoints: [{t_s: 10, r_rtn_m: [0, -40, 17], hold_s: 10}]}"
SMALL = {
    "run": ("--frames", "10", *SMALL_CAMERA),
    "preview": SMALL_CAMERA,
    "propagate": (),
    "fly": ("-o", "flight.duration_s=20", "-o", f"flight.goal={GOAL}", *SMALL_CAMERA),
    "train": ("-o", "epochs=1", "-o", "batch=2", "-o", "input_px=64"),
}
"""Command → words after those of the page that make it quick."""
SHORT = {
    "aqua-sensors": (
        *("-o", "times={t_s: [900, 900.3]}"),
        *("-o", "sensors.heat.steps=8", "-o", "sensors.heat.camera.width_px=80"),
        *("-o", "sensors.heat.camera.height_px=64"),
    )
}
"""Scenario → words that make less of it: its lidar scans ten times a second, and heat is followed for a
revolution."""
FEWER = {"--seeds": "2", "--every": "1"}
"""Option → its value here."""
NOT_RUN = {
    "adapt": "needs the nets of a recipe; tests/adaptation runs it",
    "annotate": "needs someone who clicks; tests/photos runs it",
    "crosscheck": "takes minutes, and its renderers include Blender; tests/crosscheck runs it",
    "doctor": "takes 15 s; tests/plugins runs it",
    "recipe": "takes the hours that it is given; tests/recipe runs it",
}
"""Command → why it is not run here."""
PAGES_NOT_RUN = {
    "docs/adapt.md": "needs the nets of a recipe; tests/adaptation runs it",
    "docs/annotating.md": "needs photographs and someone who clicks; tests/photos runs its commands",
    "docs/crosscheck.md": "crosscheck alone",
    "docs/experiment.md": "hours of rendering and training, by commands that other pages run in small",
    "docs/models.md": "likewise",
    "docs/plugins.md": "tests/templates makes a plugin by the template and runs its tests",
    "docs/recipe.md": "recipe alone",
    "docs/refining.md": "needs models of the reader's own",
    "docs/speed.md": "on SPEED's own folders; tests/formats has small ones",
    "docs/thesis.md": "thousands of frames; docs/dataset.md has the same commands",
    "packaging/posse-core.md": "make dist runs it, from wheels",
    "packaging/posse/README.md": "likewise",
    "plugins/render_mitsuba/README.md": "the README runs the same",
    "plugins/detect_onnx/README.md": "likewise",
}
"""Page whose commands are not run → why."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight small frames of Aqua."""
    folder = tmp_path_factory.mktemp("made") / "d"
    overrides = {
        "camera.width_px": 160,
        "camera.height_px": 120,
        "camera.hfov_deg": 60,
        "times.count": 60,
    }
    posse_core.run("aqua", folder, renderer="raster", frames=8, overrides=overrides)
    return folder


def a_dataset(dataset: Path, path: Path) -> None:
    shutil.copytree(dataset, path)


def a_scenario(dataset: Path, path: Path) -> None:
    path.write_text(
        "target: {name: aqua}\norbit: {elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000,"
        " e: 0.001, i_deg: 98, raan_deg: 10, argp_deg: 20, mean_anomaly_deg: 30}}\n"
        "relative: {roe_m: [0, 0, -16, -12, -16, -12]}\ncamera: {hfov_deg: 60}\nrenderer: raster\n"
    )


def a_mesh(dataset: Path, path: Path) -> None:
    trimesh.Scene({"bus": trimesh.creation.box((3.0, 2.0, 1.0))}).export(path)


def some_pictures(dataset: Path, path: Path) -> None:
    path.mkdir()
    for name in ("000000.png", "000003.png"):
        shutil.copy(dataset / "images" / name, path)
    cv2.imwrite(str(path / "photo.jpg"), np.full((60, 80), 30, np.uint8))


def some_labels(dataset: Path, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(dataset / "speed.json", path)
    shutil.copy(dataset / "camera.json", path.with_name("camera.json"))


def coco(dataset: Path, path: Path) -> None:
    path.mkdir()
    shutil.copytree(dataset / "images", path / "images")
    shutil.copytree(dataset / "spacecraft", path / "spacecraft")
    for part in ("train", "valid", "test"):
        shutil.copy(dataset / "coco.json", path / f"{part}.json")


TAKEN: dict[str, dict[str, Callable[[Path, Path], None]]] = {
    "README.md": {
        "f": a_dataset,
        "my.yaml": a_scenario,
        "model.glb": a_mesh,
        "photos": some_pictures,
        "train.json": some_labels,
    },
    "docs/dataset.md": {"d": a_dataset, "speedplus/synthetic/train.json": some_labels},
    "docs/detector.md": {"d": a_dataset, "photos": some_pictures, "coco": coco},
    "docs/flying.md": {},
    "docs/sensors.md": {},
    "docs/spacecraft.md": {"model.glb": a_mesh},
    "docs/tracking.md": {"SCENARIO": a_scenario, "roe1.json": some_labels},
}
"""Page whose commands are run → what it takes for granted, and how it is made here."""


def test_every_page_is_run_or_says_why_not() -> None:
    with_commands = {page for page in PAGES if any("posse " in block.text for block in shell(page))} - {
        page for page in PAGES if page.startswith("docs/tutorials/")
    }  # test_tutorials.py runs those
    assert with_commands == TAKEN.keys() | PAGES_NOT_RUN.keys()


@pytest.mark.slow
@pytest.mark.parametrize("page", TAKEN)
def test_the_commands_of_a_page_run(
    page: str, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("posse_render_raster")
    pytest.importorskip("posse_detect_torch")
    monkeypatch.chdir(tmp_path)
    for name, make in TAKEN[page].items():
        make(dataset, tmp_path / name)
    done = 0
    for block in shell(page):
        earlier = {path.name for path in tmp_path.iterdir()}
        for program, *words in commands(block, tmp_path):
            if program != "posse" or words[0] in NOT_RUN:
                continue
            if "--out" in words and words[words.index("--out") + 1] in earlier:
                out = words[words.index("--out") + 1]  # another block of the page uses the name anew
                shutil.rmtree(out, ignore_errors=True)
                earlier.remove(out)
            code, _, error = run_posse(*small(words))
            assert code == 0, f"{block.name}: posse {' '.join(words)}: {error}"
            done += 1
    assert done > 0


def small(words: list[str]) -> list[str]:
    """The command, made quick."""
    changed = [FEWER.get(before, word) for before, word in zip(["", *words], words, strict=False)]
    if "--resume" in words:
        return changed
    quick = SMALL.get(words[0], ())
    if "--refine" in words and words[0] == "detect":
        quick = ("--refine-ms", "1000")  # photographs in which there is nothing are looked at longest
    return [*changed, *quick, *(word for name in words for word in SHORT.get(name, ()))]
