"""The nets that come with the package, on frames of the scenarios ``aqua`` and ``cluster``: other
orbits, another camera, other attitudes and colours than those of their training."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from posse_core.cli.main import posse
from posse_core.dataset import Dataset
from posse_core.evaluation.metrics import box_iou

FRAMES = 4
OPTIONS = ("camera.width_px=640", "camera.height_px=480", "writers=[]", "annotators=[box,mask,pose]")


@pytest.fixture(scope="module")
def opengl() -> None:
    """Ask for this where a test needs OpenGL."""
    context = pytest.importorskip("posse_render_raster.context")
    try:
        context.create_context().release()
    except Exception as error:  # no OpenGL here
        if os.environ.get("POSSE_REQUIRE_RASTER") == "1":
            pytest.fail(f"{error} (POSSE_REQUIRE_RASTER=1)")
        pytest.skip(str(error))


def posse_run(*arguments: object) -> str:
    done = CliRunner().invoke(posse, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("name", ["aqua", "cluster"])
def test_they_find_what_they_have_not_seen(opengl: None, name: str, tmp_path: Path) -> None:
    overrides = [word for option in OPTIONS for word in ("-o", option)]
    run = ("run", name, "--renderer", "raster", "--frames", FRAMES, "--out", tmp_path / "d")
    posse_run(*run, *overrides)
    dataset = Dataset(tmp_path / "d")
    camera = dataset.folder / "camera.json"
    told = json.loads(posse_run("detect", dataset.folder / "images", "--camera", camera, "--json"))
    overlaps, ranges = [], []
    for line, row in zip(dataset.frames, told, strict=True):
        (best, *_) = row["detections"]
        assert best["label"] == name
        overlaps.append(float(box_iou(np.array([best["box_px"]]), np.array([line["box_visible_px"]]))))
        ranges.append(np.linalg.norm(best["pose"]["t_body_cam_m"]) / line["range_m"])
    assert np.median(overlaps) > 0.7
    assert abs(np.median(ranges) - 1) < 0.1
