"""Every Python block of the documentation is run: here, or by the tests that are named here."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from documents import PAGES, ROOT, Block, fenced
from scipy.spatial.transform import Rotation

import posse_core

ELSEWHERE = {
    "README.md": "tests/simulator/test_documented_examples.py",
    "docs/simulator.md": "tests/simulator/test_documented_examples.py",
    "docs/joints.md": "tests/simulator/test_documented_examples.py",
    "docs/plugins.md": "tests/plugins/test_documented_examples.py",
    "docs/dynamics.md": "tests/dynamics/test_start.py",
    "docs/detector.md": "plugins/detect_torch/tests/test_pose_dataset.py",
    **{
        page: "tests/documents/test_tutorials.py" for page in PAGES if page.startswith("docs/tutorials/")
    },
}
"""Page → the test that runs its Python."""
SENSORS = {
    "scanner": {
        "type": "lidar",
        "pattern": {
            "shape": "flash",
            "width_px": 8,
            "height_px": 6,
            "hfov_deg": 20,
            "pulse_energy_j": 5e-3,
        },
    },
    "radiance": {"type": "radiance"},
    "right": {"type": "stereo", "baseline_m": 0.3},
}
INSPECTOR = {"spacecraft": {"name": "cubesat"}, "relative": {"roe_m": [0, 5, 8, 0, 8, 0]}}


def test_what_runs_elsewhere_names_its_page() -> None:
    for page, test in ELSEWHERE.items():
        assert Path(page).stem.lower() in (ROOT / test).read_text("utf-8").lower(), test


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the data sets that the blocks open."""
    folder = tmp_path_factory.mktemp("taken")
    overrides = {
        "camera": {"width_px": 32, "height_px": 24, "hfov_deg": 60},
        "sensors": SENSORS,
        "bodies": {"companion": INSPECTOR},
        "writers": ["speed", "opencv-calibration"],
    }
    posse_core.run("aqua", folder / "d", renderer="raster", frames=13, overrides=overrides)
    lightbox = folder / "speedplus/lightbox"
    shutil.copytree(folder / "d/images", lightbox / "images")
    shutil.copy(folder / "d/speed.json", lightbox / "test.json")
    shutil.copy(folder / "d/camera.json", lightbox.parent)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    "block",
    [block for page in PAGES if page not in ELSEWHERE for block in fenced(page, "python")],
    ids=lambda block: block.name,
)
def test_a_block_runs(block: Block, taken: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("posse_render_raster")
    monkeypatch.chdir(taken)
    known = {  # what the text around the block has introduced
        "posse": posse_core,
        "cv2": cv2,
        "Rotation": Rotation,
        "dataset": (dataset := posse_core.Dataset("d")),
        "image": dataset.image(0),
        "camera": dataset.camera,
        "pose": {"q_vbs2tango_true": [1.0, 0.0, 0.0, 0.0], "r_Vo2To_vbs_true": [0.0, 0.0, 9.0]},
        "x_body": np.zeros(3),
    }
    exec(compile(block.text, block.name, "exec"), known)
