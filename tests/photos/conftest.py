"""Photographs that POSSE made: three frames of a package, with a lens, and what is true of them."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from posse_core._cli.annotate import command as annotate_command
from posse_core._cli.import_mesh import command as import_command

HALF = np.array([1.0, 0.6, 0.4])


@dataclass(frozen=True)
class Photos:
    """A folder of photographs, with the package and the camera of them, and the label line of each."""

    folder: Path
    package: Path
    camera: Path
    labels: dict[str, dict]

    def points(self, rng=None, sigma_px=0.5):
        """True places of the keypoints that are seen, by photograph and name, with noise."""
        noise = (lambda: rng.normal(0, sigma_px, 2)) if rng else (lambda: np.zeros(2))
        return {
            photo: {
                name: (np.array(point[:2]) + noise()).tolist()
                for name, point in line["keypoints"].items()
                if point[2]
            }
            for photo, line in self.labels.items()
        }


@pytest.fixture(scope="session")
def made(tmp_path_factory, posse_in) -> Path:
    """A dataset and the package of its target; tests must not change it."""
    folder = tmp_path_factory.mktemp("made")
    box, mast = trimesh.creation.box(2 * HALF), trimesh.creation.box((0.1, 0.1, 1.5))
    mast.apply_translation((0.7, 0.2, 1.1))
    trimesh.util.concatenate([box, mast]).export(folder / "craft.ply")
    given = [folder / "craft.ply", "--out", folder / "craft", "--scale", 1, "--keypoint-count", 12]
    done = CliRunner().invoke(import_command, [*map(str, given), "--centre-of-mass", "0", "0", "0"])
    assert done.exit_code == 0, done.output
    sets = (
        *("camera.width_px=800", "camera.height_px=600", "camera.hfov_deg=35", "sky.earth=false"),
        *("camera.distortion=[-0.1, 0.02, 0.001, -0.001, 0]", "sky.stars=null"),
    )
    options = [word for each in sets for word in ("-o", each)]
    run = ("run", "craft/scenario.yaml", "--renderer", "flat", "--frames", 3, "--out", "d")
    done = posse_in(folder, *run, *options)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def photos(made, tmp_path) -> Photos:
    folder = tmp_path / "photos"
    shutil.copytree(made / "d" / "images", folder)
    lines = [
        json.loads(line)
        for shard in sorted((made / "d" / "labels").glob("*.jsonl"))
        for line in shard.read_text().splitlines()
    ]
    return Photos(
        folder,
        made / "craft",
        made / "d" / "camera.json",
        {Path(line["image"]).name: line for line in lines},
    )


@pytest.fixture
def annotate(photos):
    """Run ``posse annotate`` on the photographs."""

    def call(*arguments):
        given = [photos.folder, "--target", photos.package, "--camera", photos.camera, *arguments]
        return CliRunner().invoke(annotate_command, list(map(str, given)))

    return call


@pytest.fixture
def write_points(tmp_path):
    def write(points, spacecraft="craft"):
        path = tmp_path / "points.json"
        path.write_text(json.dumps({"spacecraft": spacecraft, "photos": points}))
        return path

    return write
