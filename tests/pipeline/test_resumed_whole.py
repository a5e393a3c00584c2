"""What a resumed run calls complete, ``posse validate`` finds whole."""

import shutil

import numpy as np
import pytest

from posse_core import Dataset


def emptied(name):
    return lambda d: (d / name).write_bytes(b"")


def zeroed(d):
    with np.load(d / "trajectory.npz") as archive:
        arrays = dict(archive)
    np.savez(d / "trajectory.npz", **{**arrays, "r_sun_eci_m": np.zeros_like(arrays["r_sun_eci_m"])})


def killed_while_exporting(d):
    """What is left of an export into a folder, and of one by an older version."""
    (d / ".coco.abcd.partial" / "coco").mkdir(parents=True)
    (d / ".coco.abcd.partial" / "coco" / ".a.json.xy.partial").write_text("{")
    (d / ".speed.json.abcd.partial").write_text("[")


@pytest.mark.parametrize(
    "spoil",
    [
        zeroed,
        emptied("trajectory.npz"),
        emptied("coco.json"),
        emptied("camera.json"),
        emptied("spacecraft/box.ply"),
        emptied("renderer.json"),
        killed_while_exporting,
    ],
    ids=["motion", "trajectory", "export", "camera", "mesh", "renderer", "killed"],
)
def test_what_is_damaged_beside_frames_is_made_again(undisturbed, posse, tmp_path, spoil):
    shutil.copytree(undisturbed, tmp_path / "d")
    spoil(tmp_path / "d")
    resumed = posse("run", "--resume", "--out", "d")
    assert resumed.returncode == 0, resumed.stderr
    checked = posse("validate", "d")
    assert checked.returncode == 0, checked.stderr + checked.stdout
    assert not list((tmp_path / "d").rglob("*.partial"))
    assert Dataset(tmp_path / "d").sha256 == Dataset(undisturbed).sha256


@pytest.mark.parametrize("name", ["images/x.png", "labels/shard-00009.jsonl", "spacecraft/other.json"])
def test_files_of_others_are_named(undisturbed, posse, tmp_path, name):
    shutil.copytree(undisturbed, tmp_path / "d")
    (tmp_path / "d" / name).write_text("{}\n")
    before = sorted((tmp_path / "d").rglob("*"))
    refused = posse("run", "--resume", "--out", "d")
    assert refused.returncode == 2
    assert name in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert sorted((tmp_path / "d").rglob("*")) == before
