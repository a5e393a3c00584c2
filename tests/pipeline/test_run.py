"""Runs end in the same labels to the bit, whatever happens to them on the way."""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np
import pycocotools.mask
import pytest

# pycocotools 2.0.11 on numpy 2.4
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

FRAMES = 8


def labels_of(folder: Path) -> dict[str, bytes]:
    names = ["coco.json", "speed.json", *(f"labels/{p.name}" for p in (folder / "labels").iterdir())]
    return {name: (folder / name).read_bytes() for name in names}


def files_of(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def remarks_in(folder: Path) -> dict[str, int]:
    """Remark → number of frames, counted from the files by OpenCV and pycocotools."""
    counts = {"off_image": 0, "in_eclipse": 0, "dark": 0, "saturated": 0}
    for line in (folder / "labels/shard-00000.jsonl").read_text().splitlines():
        labels = json.loads(line)
        craft = cv2.imread(str(folder / labels["image"]), cv2.IMREAD_UNCHANGED)[
            pycocotools.mask.decode(labels["mask_rle"]) == 1
        ]
        if craft.size == 0:
            counts["off_image"] += 1
        elif labels["sun_fraction_target"] < 0.5:
            counts["in_eclipse"] += 1
        elif (craft < 0.05 * 255).mean() > 0.9:
            counts["dark"] += 1
        elif (craft > 0.98 * 255).mean() > 0.1:
            counts["saturated"] += 1
    return counts


def test_a_run_leaves_a_whole_dataset(undisturbed):
    manifest = json.loads((undisturbed / "manifest.json").read_text())
    assert manifest["state"] == "complete"
    assert manifest["frames"] == FRAMES
    assert manifest["renderer"] == {"name": "flat", "flat": "1"}
    lines = (undisturbed / "labels" / "shard-00000.jsonl").read_text().splitlines()
    assert [json.loads(line)["index"] for line in lines] == list(range(FRAMES))
    for line in map(json.loads, lines):
        assert (undisturbed / line["image"]).exists()
        assert (undisturbed / line["truth"]).exists()
        assert line["exposure_s"] == 0.002
    assert not [name for name in files_of(undisturbed) if Path(name).name.startswith(".")]


def test_checksums_are_those_of_the_standard_tool(undisturbed):
    if shutil.which("sha256sum") is None:
        pytest.skip("this machine has no sha256sum")
    checked = subprocess.run(
        ["sha256sum", "-c", "--quiet", "checksums.sha256"], cwd=undisturbed, capture_output=True
    )
    assert checked.returncode == 0, checked.stderr
    rows = (undisturbed / "checksums.sha256").read_text().splitlines()
    assert len([row for row in rows if not row.startswith("#")]) == 2 * FRAMES


def test_two_workers_make_what_one_makes(executor, undisturbed, posse, small_scenario, tmp_path):
    made = posse("run", small_scenario, "--out", "two", "--workers", 2, "--executor", executor)
    assert made.returncode == 0, made.stderr
    assert labels_of(tmp_path / "two") == labels_of(undisturbed)
    assert (tmp_path / "two/checksums.sha256").read_text() == (
        undisturbed / "checksums.sha256"
    ).read_text()


def test_a_resolved_scenario_runs_again_to_the_same_labels(undisturbed, posse, tmp_path):
    assert posse("run", undisturbed / "scenario.yaml", "--out", "again").returncode == 0
    assert labels_of(tmp_path / "again") == labels_of(undisturbed)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_run_is_resumed(workers, undisturbed, posse, start_posse, small_scenario, tmp_path):
    out = tmp_path / "killed"
    with start_posse("run", small_scenario, "--out", out, "--workers", workers) as process:
        shard = out / "labels" / "shard-00000.jsonl"
        deadline = time.monotonic() + 120
        while not (shard.exists() and shard.read_bytes().count(b"\n") >= 2):
            assert process.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
    assert not (out / "manifest.json").exists()
    resumed = posse("run", "--resume", "--out", out)
    assert resumed.returncode == 0, resumed.stderr
    assert labels_of(out) == labels_of(undisturbed)
    assert files_of(out) == files_of(undisturbed)


@pytest.fixture
def interruptible():
    """Processes that are started take SIGINT, even where a shell has started the tests in the
    background, which makes them and what they start ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_a_run_that_is_stopped_says_how_to_continue(posse, start_posse, small_scenario, tmp_path):
    slow = ("-o", "renderer.seconds=1")
    with start_posse("run", small_scenario, *slow) as process:
        deadline = time.monotonic() + 120
        while not list(tmp_path.glob("out/*/images/*.png")):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    (folder,) = tmp_path.glob("out/*")
    expected = f"posse: stopped; to continue: posse run --resume --out out/{folder.name}"
    assert error.strip().splitlines()[-1] == expected
    words = expected.partition("posse run ")[2].split()
    assert posse("run", *words).returncode == 0


@pytest.mark.parametrize("fault", ["FLAT_KILL_ONCE", "FLAT_LOSE_ONCE"])
def test_a_killed_worker_costs_nothing(fault, executor, undisturbed, posse, small_scenario, tmp_path):
    marker = tmp_path / "died"
    made = posse(
        *("run", small_scenario, "--out", "w", "--workers", 2, "--executor", executor),
        env={fault: f"3,{marker}"},
    )
    assert made.returncode == 0, made.stderr
    assert marker.exists()
    assert labels_of(tmp_path / "w") == labels_of(undisturbed)


def test_a_frame_that_hangs_is_stopped_and_tried_again(
    executor, undisturbed, posse, small_scenario, tmp_path
):
    marker = tmp_path / "hung"
    made = posse(
        *("run", small_scenario, "--out", "h", "--frame-time-limit", 12, "--executor", executor),
        env={"FLAT_HANG_ONCE": f"3,{marker}"},
    )
    assert made.returncode == 0, made.stderr
    assert marker.exists()
    assert labels_of(tmp_path / "h") == labels_of(undisturbed)


@pytest.mark.parametrize("fault", ["FLAT_KILL", "FLAT_RAISE"])
def test_a_frame_that_always_fails_is_named_and_can_be_made_later(
    fault, executor, undisturbed, posse, small_scenario, tmp_path
):
    out = tmp_path / "f"
    made = posse("run", small_scenario, "--out", out, "--executor", executor, env={fault: "3"})
    assert made.returncode == 3
    assert "frame 3 failed" in made.stderr
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["state"] == "incomplete"
    assert list(manifest["failed_frames"]) == ["3"]
    assert len(json.loads((out / "coco.json").read_text())["images"]) == FRAMES - 1
    assert posse("run", "--resume", "--out", out).returncode == 0
    assert labels_of(out) == labels_of(undisturbed)


@pytest.mark.parametrize(
    "damage",
    ["image lost", "image cut", "image flipped", "line torn", "digit flipped", "checksum lost"],
)
def test_damage_is_found_and_mended_on_resume(damage, undisturbed, posse, tmp_path):
    out = tmp_path / "damaged"
    shutil.copytree(undisturbed, out)
    image = out / "images" / "000005.png"
    shard = out / "labels" / "shard-00000.jsonl"
    if damage == "image lost":
        image.unlink()
    elif damage == "image cut":
        image.write_bytes(image.read_bytes()[:-20])
    elif damage == "image flipped":
        whole = bytearray(image.read_bytes())
        whole[len(whole) // 2] ^= 1
        image.write_bytes(whole)
    elif damage == "line torn":
        shard.write_bytes(shard.read_bytes()[:-30])
    elif damage == "digit flipped":
        one, other = re.search(rb'"index":5,"t_s":(\d)', shard.read_bytes()).span(1)
        whole = bytearray(shard.read_bytes())
        whole[one:other] = b"1" if whole[one:other] != b"1" else b"2"
        shard.write_bytes(whole)
    else:
        sums = (out / "checksums.sha256").read_text().splitlines(keepends=True)
        (out / "checksums.sha256").write_text("".join(s for s in sums if "000005.png" not in s))
    assert posse("run", "--resume", "--out", out).returncode == 0
    assert image.read_bytes() == (undisturbed / "images" / "000005.png").read_bytes()
    assert labels_of(out) == labels_of(undisturbed)
    assert files_of(out) == files_of(undisturbed)


def test_resuming_a_complete_run_changes_nothing(undisturbed, posse):
    before = {name: (undisturbed / name).stat().st_mtime_ns for name in ("manifest.json", "coco.json")}
    assert posse("run", "--resume", "--out", undisturbed).returncode == 0
    after = {name: (undisturbed / name).stat().st_mtime_ns for name in before}
    assert after == before


def test_another_scenario_is_not_mixed_in(undisturbed, posse, small_scenario):
    before = labels_of(undisturbed)
    refused = posse("run", small_scenario, "--resume", "--out", undisturbed, "--seed", 8)
    assert refused.returncode == 2
    assert "another scenario" in refused.stderr
    assert labels_of(undisturbed) == before


def test_a_second_run_on_the_folder_is_refused(posse, start_posse, small_scenario, tmp_path):
    out = tmp_path / "busy"
    with start_posse("run", small_scenario, "--out", out, "-o", "renderer.seconds=2") as process:
        while not (out / "scenario.yaml").exists():
            assert process.poll() is None
            time.sleep(0.01)
        refused = posse("run", "--resume", "--out", out)
        process.kill()
    assert refused.returncode == 2
    assert "another run is writing" in refused.stderr


def test_frames_are_spread_evenly_and_seeds_change_the_noise(posse, small_scenario, tmp_path):
    made = posse("run", small_scenario, "--out", "three", "--frames", 3)
    assert made.returncode == 0, made.stderr
    assert posse("run", small_scenario, "--out", "seed", "--frames", 3, "--seed", 8).returncode == 0
    lines = (tmp_path / "three/labels/shard-00000.jsonl").read_text().splitlines()
    times = [json.loads(line)["t_s"] for line in lines]
    assert times[0] == 0
    period_s = 2 * 3.141592653589793 * (7080000**3 / 3.986004418e14) ** 0.5
    assert times[2] == pytest.approx(period_s, rel=1e-12)
    one, other = ((tmp_path / d / "images/000000.png").read_bytes() for d in ("three", "seed"))
    assert one != other


def test_a_full_disk_is_told_and_survived(posse, small_scenario, undisturbed, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True, text=True
    )
    if mounted.returncode != 0:
        if os.environ.get("CI"):
            pytest.fail(f"CI must be able to mount a small disk: {mounted.stderr}")
        pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.strip()}")
    try:
        full = posse("run", small_scenario, "--out", disk / "d")
        assert full.returncode == 2
        assert full.stderr.strip().splitlines()[-1].startswith("posse: ")
        assert "the disk is full" in full.stderr
        assert "Traceback" not in full.stderr
        subprocess.run(["mount", "-o", "remount,size=16m", disk], check=True)
        assert posse("run", small_scenario, "--resume", "--out", disk / "d").returncode == 0
        assert labels_of(disk / "d") == labels_of(undisturbed)
    finally:
        subprocess.run(["umount", disk], check=True)


def test_events_tell_what_happens_as_it_happens(posse, small_scenario, tmp_path):
    out = tmp_path / "e"
    made = posse("run", small_scenario, "--out", out, "--json", env={"FLAT_RAISE": "3"})
    assert made.returncode == 3
    events = [json.loads(line) for line in made.stdout.splitlines()]
    assert events[0] == {"event": "started", "dataset": str(out), "frames": FRAMES, "done": 0}
    error = "ComponentError: renderer 'flat' failed: RuntimeError: the lamp is broken"
    failure = {"event": "failed", "frame": 3, "error": error}
    assert failure in events
    told = [event["frame"] for event in events if event["event"] == "frame"]
    assert sorted(told) == [0, 1, 2, 4, 5, 6, 7]
    assert events[-1].pop("seconds") > 0
    assert events[-1] == {
        "event": "finished",
        "dataset": str(out),
        "frames": FRAMES,
        "made": FRAMES - 1,
        "failed": {"3": failure["error"]},
        "remarks": remarks_in(out),
    }
    assert len(events) == 1 + FRAMES + 1
    resumed = posse("run", "--resume", "--out", out, "--json")
    first, second, last = map(json.loads, resumed.stdout.splitlines())
    assert first["done"] == FRAMES - 1
    assert second == {"event": "frame", "frame": 3}
    assert (last["event"], last["made"], last["failed"]) == ("finished", 1, {})
    assert last["remarks"] == remarks_in(out)


@pytest.mark.parametrize(
    ("radiance_w_m2_sr", "others"), [("0", "dark"), ("5e4", "saturated"), ("50", None)]
)
def test_the_last_line_says_what_is_wrong_with_frames_and_what_to_do_next(
    radiance_w_m2_sr, others, posse, small_scenario, tmp_path
):
    changes = ("-o", f"renderer.radiance_w_m2_sr={radiance_w_m2_sr}", "-o", "renderer.seconds=0")
    made = posse("run", small_scenario, "--out", "d", *changes)
    assert made.returncode == 0, made.stderr
    counts = remarks_in(tmp_path / "d")
    eclipsed = counts["in_eclipse"]
    assert 0 < eclipsed < FRAMES
    words = f"{eclipsed} in eclipse"
    if others is not None:
        assert counts[others] == FRAMES - eclipsed
        words += f", {FRAMES - eclipsed} {others}"
    assert made.stdout.splitlines()[-1] == f"8 frames: {words}; next: posse view d"
    (tmp_path / "d/images/000005.png").unlink()
    mended = posse("run", "--resume", "--out", "d")
    assert mended.stdout.splitlines()[-1] == made.stdout.splitlines()[-1]


def test_a_plugins_labels_stand_under_its_annotators_name(posse, small_scenario, tmp_path):
    made = posse(
        *("run", small_scenario, "--out", "d", "--frames", 2),
        *("-o", "annotators=[depth,nearest]"),
        *("-o", "writers=[]"),
    )
    assert made.returncode == 0, made.stderr
    for line in (tmp_path / "d/labels/shard-00000.jsonl").read_text().splitlines():
        labels = json.loads(line)
        with np.load(tmp_path / "d" / labels["truth"]) as arrays:
            assert labels["nearest"] == {"nearest_m": pytest.approx(np.nanmin(arrays["depth_m"]))}
        assert "nearest_m" not in labels


def test_an_annotator_with_the_name_of_a_label_is_refused(posse, small_scenario):
    made = posse(
        *("run", small_scenario, "--out", "d", "--frames", 1),
        *("-o", "annotators=[range_m]"),
        *("-o", "writers=[]"),
    )
    assert made.returncode == 3
    assert "annotator 'range_m': a label of POSSE's own" in made.stderr
    assert "Traceback" not in made.stderr
