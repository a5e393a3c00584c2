"""Every YAML block of the documentation is what it says it is: keys of a scenario that can be run, or a
file that is part of a spacecraft."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
import yaml
from documents import PAGES, ROOT, Block, fenced

from posse_core._plugins.loading import load_plugins
from posse_core._recipe.defaults import default_recipe
from posse_core._recipe.file import recipe_of
from posse_core._run.plan import make_plan
from posse_core._scenario.load import load_scenario

REGISTRY = load_plugins().registry
BLOCKS = [block for page in PAGES for block in fenced(page, "yaml")]
BUILT_IN = ROOT / "posse_core/_scenario/built_in"
TARGET = {"mesh": "model.glb", "scale_m_per_unit": 1.0}
ARM = {"kind": "revolute", "parts": ["bus"], "origin_m": [0, 0, 0], "axis": [0, 0, 1]}


@pytest.fixture(autouse=True)
def taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The files that the blocks name."""
    monkeypatch.chdir(tmp_path)
    parts = ("wing_left", "hinge", "tip", "wing", "bus")
    scene = trimesh.Scene({name: trimesh.creation.box((4.0, 4.0, 6.0)) for name in parts})
    scene.export("model.glb")
    Path("my-spacecraft").mkdir()
    shutil.copy("model.glb", "my-spacecraft")
    Path("my-spacecraft/spacecraft.yaml").write_text(
        "name: mine\nmesh: model.glb\nscale_m_per_unit: 1\nbody_axes: x y z\n"
        "centre_of_mass_m: [0, 0, 0]\n"
    )
    Path("lab").mkdir()
    storage = cv2.FileStorage("lab/camera.yaml", cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 64)
    storage.write("image_height", 48)
    storage.write("camera_matrix", np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]]))
    storage.write("distortion_coefficients", np.zeros(5))
    storage.release()
    shutil.copy(ROOT / "docs/flown.csv", "flown.csv")


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.name)
def test_a_block_can_be_run(block: Block) -> None:
    for keys in alternatives(block):
        if "sources" in keys.get("data", {}):
            recipe = default_recipe({"name": "aqua"}, 1.0, 1, REGISTRY).model_dump(mode="json")
            recipe_of({**recipe, **keys}, block.name)
            continue
        scenario = load_scenario(scenario_with(keys), REGISTRY)
        make_plan(scenario, REGISTRY)


def alternatives(block: Block) -> list[dict[str, Any]]:
    """The keys of a block; a block that repeats one key on each line shows alternatives."""
    lines = block.text.splitlines()
    if len({line.split(":")[0] for line in lines}) == 1 < len(lines):
        return [yaml.safe_load(line) for line in lines]
    return [yaml.safe_load(block.text)]


def scenario_with(keys: dict[str, Any]) -> dict[str, Any]:
    """A whole scenario with the keys, or one whose spacecraft has them as its own."""
    if "keypoints" in keys:
        Path("keypoints.yaml").write_text(yaml.safe_dump(keys))
        keys = {"target": {**TARGET, "keypoints": "keypoints.yaml", "joints": {"arm": ARM}}}
    elif any("kind" in joint for joint in keys.get("joints", {}).values() if isinstance(joint, dict)):
        keys = {"target": {**TARGET, "joints": keys["joints"]}}
    name = "fly-approach" if "flight" in keys else "aqua"
    base = yaml.safe_load((BUILT_IN / f"{name}.yaml").read_text("utf-8"))
    if "flight" in keys:
        keys = {**keys, "flight": {**base["flight"], **keys["flight"]}}
    if keys.get("propagator", {}) == {"name": "file", "path": "flown.csv"}:
        base = {}  # the file has the orbit
    return {**base, **keys}
