"""Runs with third parties' components that return what they must not, and with one that is sound."""

from __future__ import annotations

import json

import numpy as np
import pytest


@pytest.fixture
def run(posse, small_scenario, faulty_path):
    """posse run --out d with ``-o`` of each argument."""

    def call(*overrides: str, frames: int = 3, more: tuple[str, ...] = ()):
        words = [word for text in overrides for word in ("-o", text)]
        return posse(
            *("run", small_scenario, "--out", "d", "--frames", frames, *words, *more),
            env={"PYTHONPATH": str(faulty_path)},
        )

    return call


def test_arrays_and_values_of_many_types_are_written(run, tmp_path):
    made = run("annotators=[parts,many-types]", "writers=[]", frames=1)
    assert made.returncode == 0, made.stderr
    labels = json.loads((tmp_path / "d/labels/shard-00000.jsonl").read_text())
    assert labels["many-types"] == {
        "mean": 0.5,
        "count": 3,
        "yes": True,
        "vector": [0, 1, 2],
        "pair": [1, 2.5],
        "nested": {"name": "x", "none": None},
    }
    with np.load(tmp_path / "d" / labels["truth"]) as arrays:
        seen = arrays["part_id"] >= 0
        assert 0 < seen.sum() < seen.size
        np.testing.assert_array_equal(arrays["seen"], seen)
        np.testing.assert_array_equal(arrays["shade"], 200 * seen)
        np.testing.assert_array_equal(arrays["number"], np.where(seen, 7, -1))
        np.testing.assert_array_equal(arrays["half"], np.where(seen, 0.5, np.nan))
        np.testing.assert_array_equal(arrays["pair"][..., 0], seen)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "annotator 'faulty' returned None, and must return Labels"),
        ("nan", "annotator 'faulty': the label 'mean.x.1' is nan"),
        ("shape", "annotator 'faulty': the array 'extra' is float64 of shape (3, 4)"),
    ],
)
def test_an_annotators_fault_costs_its_frame_alone(run, posse, tmp_path, faulty_path, fault, words):
    made = run(f"annotators=[{{name: faulty, fault: {fault}}}]", "writers=[]")
    assert made.returncode == 3
    assert "Traceback" not in made.stderr
    manifest = json.loads((tmp_path / "d/manifest.json").read_text())
    assert manifest["state"] == "incomplete"
    assert manifest["failed_frames"].keys() == {"1"}
    assert words in manifest["failed_frames"]["1"]
    lines = (tmp_path / "d/labels/shard-00000.jsonl").read_text().splitlines()
    assert [json.loads(line)["index"] for line in lines] == [0, 2]
    again = posse("run", "--resume", "--out", "d", env={"PYTHONPATH": str(faulty_path)})
    assert again.returncode == 3
    assert json.loads((tmp_path / "d/manifest.json").read_text())["failed_frames"].keys() == {"1"}


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "renderer 'faulty' returned None, and must return Radiance"),
        ("shape", "renderer 'faulty': radiance_rgb is float32 of shape"),
    ],
)
def test_a_renderers_fault_is_named(run, tmp_path, fault, words):
    made = run(f"renderer={{name: faulty, fault: {fault}}}", "writers=[]", frames=1)
    assert made.returncode == 3
    assert "Traceback" not in made.stderr
    assert words in json.loads((tmp_path / "d/manifest.json").read_text())["failed_frames"]["0"]


def test_frames_that_an_executor_does_not_return_are_named(run, tmp_path):
    made = run("writers=[]", more=("--executor", "lazy"))
    assert made.returncode == 3, made.stderr
    manifest = json.loads((tmp_path / "d/manifest.json").read_text())
    assert manifest["failed_frames"] == {"1": "the executor gave no result"}
    assert manifest["state"] == "incomplete"


def test_a_writers_fault_is_named(run, tmp_path):
    made = run("writers=[{name: faulty, fault: outside}]", frames=1)
    assert made.returncode == 3
    assert "writer 'faulty' returned" in made.stderr
    assert "Traceback" not in made.stderr
    assert not (tmp_path / "d/manifest.json").exists()


def test_what_a_writer_wrote_is_validated(run, posse, faulty_path, tmp_path):
    made = run("writers=[faulty,coco]", frames=2)
    assert made.returncode == 0, made.stderr
    folder = tmp_path / "d"
    exports = json.loads((folder / "manifest.json").read_text())["exports"]
    assert exports.keys() == {"ranges.txt", "extra/deep/more.txt", "coco.json"}
    assert posse("validate", "d").returncode == 0
    (folder / "extra/deep/more.txt").write_text("else")
    checked = posse("validate", "d")
    assert checked.returncode == 1
    assert "extra/deep/more.txt: not as it was written" in checked.stdout
    mended = posse("export", "d", "--format", "faulty", env={"PYTHONPATH": str(faulty_path)})
    assert mended.returncode == 0, mended.stderr
    assert posse("validate", "d").returncode == 0


def test_a_manifest_that_names_a_file_elsewhere_is_refused(run, posse, tmp_path):
    assert run("writers=[]", frames=1).returncode == 0
    (tmp_path / "secret").write_text("secret")
    path = tmp_path / "d/manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "exports": {"../secret": "0" * 64}}))
    checked = posse("validate", "d")
    assert checked.returncode == 2
    assert "'../secret'" in checked.stderr
