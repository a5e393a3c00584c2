"""Runs of a craft with joints end in the same labels to the bit, whatever happens to them on the way."""

import json
import shutil
import signal
import time
from pathlib import Path

import pytest
from scipy.spatial.transform import Rotation

SCENARIO = """\
target: {name: cubesat}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000, e: 0.001, i_deg: 98, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {roe_m: [0, 0, 1, 0, 1, 0]}
times: {duration_s: 600, count: 6}
joints:
  wing_left: {law: table, path: opening.csv}
  wing_right: random
camera: {width_px: 64, height_px: 48}
sky: {earth: false, stars: null}
renderer: {name: flat, seconds: 0.05}
writers: [coco]
seed: 7
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("joints")
    rows = ["t_s,value_deg", "0,90", "200,60", "400,0"]
    (folder / "opening.csv").write_text("\n".join(rows))
    path = folder / "joints.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def undisturbed(posse_in, scenario) -> Path:
    done = posse_in(scenario.parent, "run", scenario, "--out", "undisturbed")
    assert done.returncode == 0, done.stderr
    return scenario.parent / "undisturbed"


def lines(dataset: Path) -> bytes:
    return (dataset / "labels" / "shard-00000.jsonl").read_bytes()


def test_the_labels_are_by_the_laws(undisturbed) -> None:
    """One wing opens by the table and rests at its end; the other is drawn anew in every frame, within
    its hinge's limits. SciPy turns the wing."""
    labels = [json.loads(line) for line in lines(undisturbed).splitlines()]
    left = [line["joints"]["wing_left"] for line in labels]
    assert left[0]["value"] == pytest.approx(1.5707963267948966)
    assert [each["value"] for each in left[4:]] == pytest.approx([0, 0], abs=1e-12)
    assert [each["rate"] for each in left[4:]] == pytest.approx([0, 0], abs=1e-12)
    closing = [each["value"] for each in left[:4]]
    assert closing == sorted(set(closing), reverse=True)
    right = [line["joints"]["wing_right"] for line in labels]
    assert len({each["value"] for each in right}) == len(labels)
    assert all(0 <= each["value"] <= 1.5707963267948966 and each["rate"] == 0 for each in right)
    for line, each in zip(labels, right, strict=True):
        body, link = (
            Rotation.from_quat(q, scalar_first=True)
            for q in (line["q_cam_from_body"], each["q_cam_from_link"])
        )
        assert (body.inv() * link).as_rotvec() == pytest.approx([0, 0, each["value"]], abs=1e-12)


def test_two_workers_make_what_one_makes(undisturbed, posse_in, scenario) -> None:
    done = posse_in(scenario.parent, "run", scenario, "--out", "two", "--workers", 2)
    assert done.returncode == 0, done.stderr
    assert lines(scenario.parent / "two") == lines(undisturbed)


def test_a_killed_run_is_resumed(undisturbed, posse_in, start_posse_in, scenario) -> None:
    out = scenario.parent / "killed"
    with start_posse_in(scenario.parent, "run", scenario, "--out", out) as process:
        shard, deadline = out / "labels" / "shard-00000.jsonl", time.monotonic() + 120
        while not (shard.exists() and shard.read_bytes().count(b"\n") >= 2):
            assert process.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
    assert not (out / "manifest.json").exists()
    resumed = posse_in(scenario.parent, "run", "--resume", "--out", out)
    assert resumed.returncode == 0, resumed.stderr
    assert lines(out) == lines(undisturbed)


def test_a_dataset_runs_again_without_the_table_it_was_made_from(
    undisturbed, posse_in, tmp_path
) -> None:
    """It has a copy."""
    moved = tmp_path / "moved"
    shutil.copytree(undisturbed, moved)
    done = posse_in(tmp_path, "run", moved / "scenario.yaml", "--out", "again")
    assert done.returncode == 0, done.stderr
    assert lines(tmp_path / "again") == lines(undisturbed)
    assert (moved / "inputs" / "joints.wing_left.path" / "opening.csv").is_file()
