"""The nets that come with the package, on frames of the thesis' own orbits, which their training did
not see, by another camera."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run_posse

from posse_core import Dataset, LabelLine

FRAMES = 25
SCENARIOS = {"aqua": "posse-v2", "cluster": "posse-v1"}
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
    code, out, error = run_posse(*arguments)
    assert code == 0, error
    return out


def overlap(*boxes_px: Sequence[float]) -> float:
    """Intersection over union of two boxes x, y, width, height."""
    low, size = np.split(np.array(boxes_px), 2, axis=1)
    common = np.clip((low + size).min(axis=0) - low.max(axis=0), 0, None).prod()
    return float(common / (size.prod(axis=1).sum() - common))


def sunlit(
    scenario: str, frames: int, folder: Path, run: Sequence[str] = (), detect: Sequence[str] = ()
) -> list[tuple[LabelLine, list[dict[str, Any]]]]:
    """The labels of a scenario's frames that are lit, each with what the shipped nets detect there."""
    overrides = [word for option in (*OPTIONS, *run) for word in ("-o", option)]
    posse_run("run", scenario, "--renderer", "raster", "--frames", frames, "--out", folder, *overrides)
    # Where little or nothing is to be seen, a detector looks longest.
    lit = [
        line for line in Dataset(folder) if line.sun_fraction_target > 0.5 and line.fraction_lit > 0.05
    ]
    images, camera = folder / "lit", folder / "camera.json"
    images.mkdir()
    for line in lit:
        shutil.copy(folder / "images" / f"{line.index:06d}.png", images)
    told = json.loads(posse_run("detect", images, *detect, "--camera", camera, "--json"))
    return [(line, row["detections"]) for line, row in zip(lit, told, strict=True)]


@pytest.mark.parametrize(("name", "range_error"), [("aqua", 0.6), ("cluster", 0.1)])
def test_they_find_what_they_have_not_seen(
    opengl: None, name: str, range_error: float, tmp_path: Path
) -> None:
    lit = sunlit(SCENARIOS[name], FRAMES, tmp_path / "d")
    assert len(lit) >= 3
    overlaps, ranges = [], []
    for line, found in lit:
        if found and found[0]["label"] == name:
            overlaps.append(overlap(found[0]["box_px"], line.box_visible_px))
            ranges.append(np.linalg.norm(found[0]["pose"]["t_body_cam_m"]) / line.range_m)
    assert len(overlaps) > 0.7 * len(lit)
    assert np.median(overlaps) > 0.6
    assert abs(np.median(ranges) - 1) < range_error


@pytest.mark.parametrize("name", ["aqua", "cluster"])
def test_they_are_known_in_any_attitude(opengl: None, name: str, tmp_path: Path) -> None:
    """By their own nets, at random attitudes, which differ by 126° in the median; before refinement."""
    run = ("attitude.target={law: random}", "sky.stars.gain=10000")
    lit = sunlit(f"posse-{name}-earth", 40, tmp_path / "d", run, ("--target", name))
    turns_deg = []
    for line, found in lit:
        q = found[0]["pose"]["q_cam_from_body"] if found and found[0].get("pose") else None
        turns_deg.append(180.0 if q is None else turn_deg(q, line.q_cam_from_body))
    assert len(turns_deg) >= 5
    assert np.median(turns_deg) < 30


def turn_deg(one: Sequence[float], other: Sequence[float]) -> float:
    """The angle between two attitudes."""
    return float(np.degrees(2 * np.arccos(min(1.0, abs(float(np.dot(one, other)))))))
