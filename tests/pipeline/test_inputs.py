"""Datasets hold what their scenarios name: they are moved, made again, resumed, proven and joined."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from command import run_posse
from small_run import BOX_OBJ, SCENARIO

from posse_core._dataset.dataset import Dataset
from posse_core._errors import StoreError
from posse_core._files.store import RemoteStore
from posse_core._formats.images import write_png

KEYPOINTS = "keypoints: {T1: [-2, -1, 1], B1: [2, 1, -1], B2: [-2, 1, -1]}\n"
BEAMS = "t_s,r_beam_x,r_beam_y,r_beam_z\n0,0,0,1\n0.1,0.01,0,1\n"
FILES = """\
propagator: {name: file, path: motion/flown.csv}
attitude: {target: {law: file, path: motion/flown.csv}}
sensors:
  scanner: {type: lidar, pattern: {shape: given, path: beams.csv}}
"""
TARGET = "target: {mesh: craft/box.obj, keypoints: craft/points.yaml, scale_m_per_unit: 1.0}\n"
LABELS = "labels/shard-00000.jsonl"
INPUTS = {
    "inputs/attitude.target.path/flown.csv",
    "inputs/propagator.path/flown.csv",
    "inputs/sensors.scanner.pattern.path/beams.csv",
    "inputs/target.keypoints/points.yaml",
    "inputs/target.mesh/box.obj",
    "inputs/target.mesh/paint/box.mtl",
    "inputs/target.mesh/paint/tiles.png",
}


def write_files(folder: Path) -> None:
    """A scenario and everything that it names."""
    craft = folder / "craft"
    (craft / "paint").mkdir(parents=True)
    (folder / "motion").mkdir()
    vertices, surfaces = BOX_OBJ.split("f ", 1)
    textured = re.sub(r"(\d+)", r"\1/1", f"f {surfaces}")
    (craft / "box.obj").write_text(f"mtllib paint/box.mtl\n{vertices}vt 0 0\nusemtl tiles\n{textured}")
    (craft / "paint/box.mtl").write_text("newmtl tiles\nKd 1 1 1\nmap_Kd tiles.png\n")
    write_png(craft / "paint/tiles.png", np.full((4, 4, 3), (200, 30, 60), np.uint8))
    (craft / "points.yaml").write_text(KEYPOINTS)
    (folder / "beams.csv").write_text(BEAMS)
    lines = SCENARIO.splitlines(keepends=True)[1:]
    (folder / "first.yaml").write_text(TARGET + "".join(lines))
    (folder / "s.yaml").write_text(TARGET + "".join(lines) + FILES)


@pytest.fixture(scope="session")
def travelled(posse_in, tmp_path_factory) -> Path:
    """A dataset in another folder than it was made in, where nothing else is left. Do not change it."""
    home = tmp_path_factory.mktemp("home")
    write_files(home)
    flown = posse_in(home, "propagate", "first.yaml", "--out", "motion/flown.csv")
    assert flown.returncode == 0, flown.stderr
    made = posse_in(home, "run", "s.yaml", "--out", "d")
    assert made.returncode == 0, made.stderr
    away = tmp_path_factory.mktemp("away") / "d"
    shutil.move(home / "d", away)
    shutil.rmtree(home)
    assert str(home) not in "".join(
        path.read_text()
        for pattern in ("*.yaml", "*.json", "sensors/*.json")
        for path in away.glob(pattern)
    )
    return away


@pytest.fixture
def copy(travelled, tmp_path) -> Path:
    return shutil.copytree(travelled, tmp_path / "copy")


def test_every_file_is_there_with_its_digest(travelled):
    there = {str(p.relative_to(travelled)) for p in (travelled / "inputs").rglob("*") if p.is_file()}
    assert there == INPUTS
    assert set(Dataset(travelled).manifest.sha256) >= INPUTS
    keys = yaml.safe_load((travelled / "scenario.yaml").read_text())
    assert keys["target"]["mesh"] == "inputs/target.mesh/box.obj"
    assert keys["sensors"]["scanner"]["pattern"]["path"] in INPUTS


def test_the_same_labels_again(posse_in, travelled, tmp_path):
    again = posse_in(tmp_path, "run", travelled / "scenario.yaml", "--out", "again", "--workers", "2")
    assert again.returncode == 0, again.stderr
    for name in (LABELS, "checksums.sha256", "scenario.yaml", "trajectory.npz", *INPUTS):
        assert (tmp_path / "again" / name).read_bytes() == (travelled / name).read_bytes()


def test_a_run_goes_on_elsewhere(posse_in, travelled, copy):
    (copy / "manifest.json").unlink()
    (copy / "images/000003.png").unlink()
    done = posse_in(copy.parent, "run", "--resume", "--out", "copy")
    assert done.returncode == 0, done.stderr
    assert "1 frames made of 8" in done.stdout
    for name in (LABELS, "checksums.sha256", "scenario.yaml", *INPUTS):
        assert (copy / name).read_bytes() == (travelled / name).read_bytes()


def test_it_is_proven_and_a_damaged_or_foreign_input_found(copy):
    assert run_posse("validate", copy)[0] == 0
    (copy / "inputs/more.txt").write_text("x")
    (copy / "inputs/sensors.scanner.pattern.path/beams.csv").write_text(BEAMS + "0.2,0,0,1\n")
    (copy / "inputs/target.mesh/box.obj").unlink()
    code, out, _ = run_posse("validate", copy, "--json")
    assert code == 1
    faults = {
        check["name"]: [fault["message"] for fault in check["faults"]]
        for check in json.loads(out)["checks"]
        if check["faults"]
    }
    assert faults["leftovers"] == ["inputs/more.txt: the manifest does not name it"]
    assert faults["checksums"] == [
        "inputs/sensors.scanner.pattern.path/beams.csv: not as it was written",
        "inputs/target.mesh/box.obj: missing",
    ]


def test_joined_datasets_keep_the_inputs_of_each(travelled, copy, tmp_path):
    both = tmp_path / "both"
    code, _, error = run_posse("collect", travelled, copy, "--out", both)
    assert code == 0, error
    for number in (0, 1):
        source = both / "sources" / str(number)
        assert (source / "scenario.yaml").read_bytes() == (travelled / "scenario.yaml").read_bytes()
        for name in INPUTS:
            assert (source / name).read_bytes() == (travelled / name).read_bytes()
    code, out, _ = run_posse("validate", both)
    assert code == 0, out
    assert "scanner" in out
    assert "only pose and files were checked" not in out


def test_sensors_with_other_files_are_not_joined(travelled, copy, tmp_path):
    beams = copy / "inputs/sensors.scanner.pattern.path/beams.csv"
    beams.write_text(BEAMS + "0.2,0,0,1\n")
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["sha256"][str(beams.relative_to(copy))] = "0"
    (copy / "manifest.json").write_text(json.dumps(manifest))
    code, _, error = run_posse("collect", travelled, copy, "--out", tmp_path / "both")
    assert code == 2
    assert "its sensors are not those of" in error


def test_resuming_with_a_changed_file_is_refused(posse_in, small_scenario, undisturbed, tmp_path):
    shutil.copytree(undisturbed, tmp_path / "d")
    (tmp_path / "small.yaml").write_text(small_scenario.read_text())
    (tmp_path / "box.obj").write_text(BOX_OBJ.replace("v 2 1 1", "v 2 1 1.5"))
    refused = posse_in(tmp_path, "run", "small.yaml", "--resume", "--out", "d")
    assert refused.returncode == 2
    assert "box.obj: is not the file inputs/target.mesh/box.obj" in refused.stderr
    (tmp_path / "box.obj").write_text(BOX_OBJ)
    (tmp_path / "d/inputs/target.mesh/box.obj").write_text("damaged")
    mended = posse_in(tmp_path, "run", "small.yaml", "--resume", "--out", "d")
    assert mended.returncode == 0, mended.stderr
    assert (tmp_path / "d/inputs/target.mesh/box.obj").read_text() == BOX_OBJ


def test_a_dataset_of_absolute_paths_goes_on(posse_in, small_scenario, undisturbed, tmp_path):
    """As earlier versions wrote them: without copies, and without keys that came later."""
    old = shutil.copytree(undisturbed, tmp_path / "d")
    shutil.rmtree(old / "inputs")
    text = (old / "scenario.yaml").read_text()
    path = str(small_scenario.parent / "box.obj")
    assert "  rate_hz: null\n" in text
    text = text.replace("inputs/target.mesh/box.obj", path).replace("  rate_hz: null\n", "")
    (old / "scenario.yaml").write_text(text)
    (old / "manifest.json").unlink()
    (old / "images/000002.png").unlink()
    done = posse_in(tmp_path, "run", "--resume", "--out", "d")
    assert done.returncode == 0, done.stderr
    assert "1 frames made of 8" in done.stdout
    assert (old / LABELS).read_bytes() == (undisturbed / LABELS).read_bytes()
    assert not (old / "inputs").exists()


def test_a_package_in_a_dataset_is_what_it_needs(posse_in, small_scenario, tmp_path):
    box = small_scenario.parent / "box.obj"
    code, _, error = run_posse("import", box, "--scale", 1, "--out", tmp_path / "box")
    assert code == 0, error
    (tmp_path / "box/notes.txt").write_text("not needed")
    given = ("-o", "target={package: box}", "-o", "times={count: 1}")
    scenario = tmp_path / "s.yaml"
    scenario.write_text(SCENARIO)
    assert posse_in(tmp_path, "run", "s.yaml", *given, "--out", "d").returncode == 0
    there = {str(p.relative_to(tmp_path / "d/inputs")) for p in (tmp_path / "d/inputs").rglob("*.*")}
    assert there == {"target.package", "target.package/box.obj", "target.package/spacecraft.yaml"}
    shutil.rmtree(tmp_path / "box")
    again = posse_in(tmp_path, "run", "d/scenario.yaml", "--out", "again")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again" / LABELS).read_bytes() == (tmp_path / "d" / LABELS).read_bytes()


@pytest.mark.parametrize("way", ["above", "link", "linked folder"])
def test_no_path_leads_out_of_a_dataset(posse_in, copy, tmp_path, way):
    secret = tmp_path / "secret"
    secret.mkdir()
    shutil.copy(copy / "inputs/propagator.path/flown.csv", secret)
    scenario, flown = copy / "scenario.yaml", copy / "inputs/propagator.path/flown.csv"
    if way == "above":
        text = scenario.read_text()
        scenario.write_text(text.replace("inputs/propagator.path/flown.csv", "../secret/flown.csv"))
    elif way == "link":
        flown.unlink()
        flown.symlink_to(secret / "flown.csv")
    else:
        shutil.rmtree(flown.parent)
        flown.parent.symlink_to(secret)
    refused = posse_in(tmp_path, "run", scenario, "--out", "again")
    assert refused.returncode == 2
    assert "propagator.path" in refused.stderr
    assert "leads out of" in refused.stderr
    assert not (tmp_path / "again").exists()


def test_no_name_in_a_store_leads_out_of_a_dataset(server):
    server.mkdir("leading")
    server.pipe_file("s3://leading/d/scenario.yaml", b"target: {name: aqua}\n")
    server.pipe_file("s3://leading/d/inputs/../../escaped.txt", b"x")
    store = RemoteStore("s3://leading/d")
    copied = store.local_copy("scenario.yaml", "inputs")
    with pytest.raises(StoreError, match="leads out of"), copied:
        pass
    server.rm("leading", recursive=True)
