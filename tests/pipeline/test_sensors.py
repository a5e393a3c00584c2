"""Datasets with sensors beside the camera: made, killed and resumed, proven, joined, and read back."""

import hashlib
import json
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.result import Report
from posse_core._evaluation.validate import validate
from posse_core._files.atomic import sha256
from posse_core._run.shards import LabelLog

SENSORS = """\
times: {duration_s: 1400, count: 8}
sensors:
  twin: {type: camera, sensor: {noise: {shot: false, read_e: 0, dark_e_s: 0}}}
  side:
    type: camera
    mount: {position_m: [0.3, 0, 0], rotation_vector_deg: [0, 5, 0]}
    rate_hz: 0.01
    camera: {width_px: 48, height_px: 36, hfov_deg: 80, line_time_s: 0.0005}
  light: {type: radiance, dtype: float16}
"""


@pytest.fixture(scope="session")
def sensor_scenario(small_scenario) -> Path:
    text = small_scenario.read_text().replace("times: {duration_orbits: 1, count: 8}\n", "")
    text = text.replace("noise: {gaussian_dn: 3}", "noise: {shot: false, read_e: 0, dark_e_s: 0}")
    path = small_scenario.parent / "sensors.yaml"
    path.write_text(text + SENSORS)
    return path


@pytest.fixture(scope="session")
def whole(posse_in, sensor_scenario) -> Path:
    """The dataset with sensors, made in one go. Tests must not change it."""
    done = posse_in(sensor_scenario.parent, "run", sensor_scenario, "--out", "with-sensors")
    assert done.returncode == 0, done.stderr
    return sensor_scenario.parent / "with-sensors"


@pytest.fixture
def copy(whole, tmp_path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "d"))


def files_of(folder: Path) -> dict[str, str]:
    parts = ("images", "truth", "sensors", "labels")
    paths = [path for part in parts for path in (folder / part).rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): sha256(path) for path in paths}


def prove(folder: Path) -> Report:
    return validate(Dataset(folder), lambda places, frames: places)


def test_a_dataset_with_sensors_proves_itself(whole):
    report = prove(whole)
    assert report.passed, [f for r in report.results for f in r.faults][:3]
    checked = {result.name: result.checked for result in report.results}
    assert checked["sensor twin"] == checked["sensor side"] == 8


def test_the_camera_is_as_without_sensors(whole, posse, sensor_scenario, tmp_path):
    """Every image, array and label to the bit."""
    keys = sensor_scenario.read_text().partition("sensors:\n")[0]
    alone = sensor_scenario.parent / "alone.yaml"
    alone.write_text(keys)
    assert posse("run", alone, "--out", "alone").returncode == 0
    for one, other in zip(Dataset(whole), Dataset(tmp_path / "alone"), strict=True):
        labels = one.as_json()
        assert [*labels.pop("sensors")] == ["twin", "side", "light"]
        assert labels == other.as_json()
    ours, theirs = files_of(whole), files_of(tmp_path / "alone")
    assert theirs.keys() - ours.keys() == set()
    assert all(ours[name] == theirs[name] for name in theirs if not name.startswith("labels"))
    assert not (tmp_path / "alone" / "sensors").exists()


def test_a_camera_in_the_same_place_sees_the_same(whole):
    """Without noise the twin's image is the camera's, to the bit, and so are its arrays and its pose."""
    dataset = Dataset(whole)
    for i, labels in enumerate(dataset):
        (reading,) = dataset.readings(i, "twin")
        assert reading.image is not None
        np.testing.assert_array_equal(reading.image, dataset.image(i))
        np.testing.assert_array_equal(reading.arrays["depth_m"], dataset.depth(i))
        (said,) = labels.sensors["twin"]
        assert said.q_sensor_from_body == labels.q_cam_from_body
        assert reading.labels["keypoints"] == json.loads(labels.to_json())["keypoints"]


def test_the_light_of_every_image_is_kept_and_proven(whole, copy):
    dataset = Dataset(whole)
    for i in range(len(dataset)):
        (reading,) = dataset.readings(i, "light")
        radiance = reading.arrays["radiance_rgb"]
        assert (radiance.dtype, radiance.shape) == (np.float16, (48, 64, 3))
        bright = radiance.astype(float).sum(axis=2) > 1
        assert bright[dataset.image(i) > 40].all()
    path = copy / "sensors/light/000003.npz"
    np.savez(path, radiance_rgb=np.full((48, 64, 3), np.nan, np.float16))
    (result,) = [r for r in prove(copy).results if r.name == "sensor light"]
    assert [fault.frame for fault in result.faults] == [3]
    assert "radiance_rgb is negative or not finite" in result.faults[0].message


def test_a_sensor_reads_at_its_own_rate_until_the_next_frame(whole):
    """Frames are 200 s apart, the sensor reads every 100 s; after the last frame nothing follows."""
    dataset = Dataset(whole)
    taken = [[reading.t_s for reading in labels.sensors["side"]] for labels in dataset]
    assert taken == [[200.0 * i, 200.0 * i + 100] for i in range(7)] + [[1400.0]]
    names = [reading.files[0] for reading in dataset[2].sensors["side"]]
    assert names == ["sensors/side/000002.npz", "sensors/side/000002_0001.npz"]
    camera = dataset.sensors["side"].camera
    assert camera is not None
    assert (camera.width_px, camera.line_time_s) == (48, 0.0005)
    assert dataset.readings(2, "side")[1].image.shape == (36, 48)


def test_a_killed_run_with_sensors_is_resumed_to_the_bit(
    whole, posse, start_posse, sensor_scenario, tmp_path
):
    out = tmp_path / "killed"
    with start_posse("run", sensor_scenario, "--out", out, "--workers", 2) as process:
        shard = out / "labels" / "shard-00000.jsonl"
        deadline = time.monotonic() + 120
        while not (shard.exists() and shard.read_bytes().count(b"\n") >= 2):
            assert process.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
    for kind in ("side/*.png", "light/*.npz"):
        damaged = sorted((out / "sensors").glob(kind))[0]
        damaged.write_bytes(damaged.read_bytes()[:-1])
    resumed = posse("run", "--resume", "--out", out)
    assert resumed.returncode == 0, resumed.stderr
    assert files_of(out) == files_of(whole)
    assert prove(out).passed


@pytest.mark.parametrize("executor", ["ray"], indirect=True)
def test_another_executor_makes_the_same_readings(executor, whole, posse, sensor_scenario, tmp_path):
    made = posse("run", sensor_scenario, "--out", "r", "--executor", executor, "--workers", 2)
    assert made.returncode == 0, made.stderr
    assert files_of(tmp_path / "r") == files_of(whole)


def test_a_network_store_holds_the_same_readings(server, whole, posse, sensor_scenario):
    server.mkdir("with-sensors")
    url = "s3://with-sensors/d"
    cut = posse("run", sensor_scenario, "--out", url)
    assert cut.returncode == 0, cut.stderr
    server.rm_file("with-sensors/d/sensors/side/000005.png")
    mended = posse("run", "--resume", "--out", url)
    assert mended.returncode == 0, mended.stderr
    assert "1 frames made of 8" in mended.stdout
    held = {
        name.removeprefix("with-sensors/d/"): hashlib.sha256(server.cat_file(name)).hexdigest()
        for name in server.find("with-sensors/d")
    }
    ours = files_of(whole)
    assert {name: held.get(name) for name in ours} == ours


def test_joined_datasets_keep_their_readings(whole, copy, posse, tmp_path):
    assert posse("collect", whole, copy, "--out", "both").returncode == 0
    both = Dataset(tmp_path / "both")
    report = prove(tmp_path / "both")
    found = {result.name: result.faults for result in report.results}
    assert not found["sensor side"]
    assert not found["checksums"]
    assert both[9].sensors["side"][1].files[0] == "sensors/side/000009_0001.npz"
    np.testing.assert_array_equal(
        both.readings(9, "side")[1].image, Dataset(whole).readings(1, "side")[1].image
    )


def test_datasets_of_other_sensors_are_not_joined(whole, copy, posse):
    path = copy / "sensors" / "side.json"
    path.write_text(path.read_text().replace("0.3", "0.4"))
    done = posse("collect", whole, copy, "--out", "both")
    assert done.returncode == 2
    assert "its sensors are not those of" in done.stderr


def test_a_sensor_that_is_not_there_is_named(whole):
    with pytest.raises(InputError, match=r"frame 0 has no sensor 'sid'; did you mean 'side'"):
        Dataset(whole).readings(0, "sid")


def change(folder: Path, alter: Callable[[dict[str, Any]], None], index: int = 3) -> None:
    """Alter one label line, and log the frames anew as a program that writes wrong labels would."""
    shard = folder / "labels" / "shard-00000.jsonl"
    lines = [json.loads(line) for line in shard.read_text().splitlines()]
    alter(lines[index])
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
    shard.write_text(text)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["sha256"]["labels/shard-00000.jsonl"] = sha256(shard)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def swapped(line: dict[str, Any]) -> None:
    first, second = line["sensors"]["side"]
    first["files"], second["files"] = second["files"], first["files"]


def mirrored(line: dict[str, Any]) -> None:
    line["sensors"]["side"][0]["t_body_sensor_m"][0] *= -1


def elsewhere(line: dict[str, Any]) -> None:
    reading = line["sensors"]["side"][1]
    labels = reading["labels"]
    for place in (reading["t_body_sensor_m"], labels["t_body_cam_m"]):
        place[2] += 0.5
    labels["range_m"] = float(np.linalg.norm(labels["t_body_cam_m"]))


def gone(line: dict[str, Any]) -> None:
    del line["sensors"]["side"]


def strange(line: dict[str, Any]) -> None:
    line["sensors"]["other"] = line["sensors"].pop("side")


@pytest.mark.parametrize(
    ("alter", "sensor", "words"),
    [
        (swapped, "side", "reading 0: "),
        (mirrored, "side", "not the reading's pose"),
        (elsewhere, "side", "reading 1: depth: "),
        (gone, "side", "the frame has no reading of it"),
        (strange, "other", "has no description"),
    ],
)
def test_a_planted_fault_is_found(copy, alter, sensor, words):
    change(copy, alter)
    (result,) = [r for r in prove(copy).results if r.name == f"sensor {sensor}"]
    assert {fault.frame for fault in result.faults} >= {3}
    assert any(words in fault.message for fault in result.faults), result.faults


def test_a_reading_that_no_frame_names_is_found(copy):
    shutil.copy(copy / "sensors/side/000000.png", copy / "sensors/side/000099.png")
    (result,) = [r for r in prove(copy).results if r.name == "leftovers"]
    assert [fault.message for fault in result.faults] == ["sensors/side/000099.png: no frame names it"]


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("sensors.side.type=camrea", "no sensor named 'camrea'; did you mean 'camera'"),
        ("sensors.side.mount.place=[0,0,0]", "sensors.side.mount.place: unknown key"),
        ("sensors.side.lens=1", "sensors.side.lens: unknown key"),
        ("sensors.side.rate_hz=1e6", "sensors.side.rate_hz: 200000000 readings"),
        ("sensors.Side={type: camera}", "'Side' cannot be a folder's name"),
    ],
)
def test_a_mistake_is_told_in_one_line(posse, sensor_scenario, tmp_path, option, words):
    done = posse("run", sensor_scenario, "--out", "d", "-o", option)
    assert done.returncode == 2, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_the_log_of_frames_counts_the_files_of_sensors(copy):
    """A frame whose reading has changed is made again."""
    path = copy / "sensors/side/000004_0001.npz"
    path.write_bytes(b"not an array")
    log = LabelLog(copy, 8)
    assert log.recover(lambda name: sha256(copy / name)) == {0, 1, 2, 3, 5, 6, 7}
