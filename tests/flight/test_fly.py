"""``posse fly`` as a user runs it: the folder, going on after a kill, many seeds, and bad input."""

import hashlib
import json
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from small_flight import SCENARIO

from posse_core import Dataset
from posse_core._files.flight import load_flight

SENSORS = """\
sensors:
  right: {type: camera, mount: {position_m: [0.5, 0, 0]}, rate_hz: 1}
"""


def digests(folder: Path) -> dict[str, str]:
    """Every file but those that describe the machine or the moment."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("renderer.json", "flight.html")
    }


@pytest.fixture(scope="module")
def flown(posse_in, tmp_path_factory) -> Path:
    """A flight in one go. Tests must not change it."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "small.yaml").write_text(SCENARIO + SENSORS)
    done = posse_in(folder, "fly", "small.yaml", "--out", "d")
    assert done.returncode == 0, done.stderr
    assert "range" in done.stdout
    return folder / "d"


def test_the_folder_is_a_dataset_that_validates(posse_in, flown):
    done = posse_in(flown.parent, "validate", "d")
    assert done.returncode == 0, done.stdout
    assert len(Dataset(flown)) == 9
    assert ["sensor", "right", "9", "0"] in [line.split()[:4] for line in done.stdout.splitlines()]


def test_a_sensor_reads_at_each_frame_of_a_flight(flown):
    """What follows a frame is not known before the chaser has decided on its next impulse."""
    dataset = Dataset(flown)
    for i, labels in enumerate(dataset):
        (reading,) = labels.sensors["right"]
        assert reading.t_s == labels.t_s
        place_m = np.array(labels.t_body_cam_m) - [0.5, 0, 0]
        np.testing.assert_allclose(reading.t_body_sensor_m, place_m, atol=1e-12)
        assert dataset.readings(i, "right")[0].image.shape == (48, 64)


def test_the_record_is_of_the_frames(flown):
    dataset, record = Dataset(flown), load_flight(flown / "flight.npz")
    np.testing.assert_array_equal(record.t_s, 10.0 * np.arange(9))
    np.testing.assert_array_equal(record.t_s, [labels.t_s for labels in dataset])
    np.testing.assert_allclose(
        np.linalg.norm(record.r_true_rtn_m, axis=1), [labels.range_m for labels in dataset]
    )
    np.testing.assert_array_equal(record.r_true_rtn_m, dataset.trajectory.r_chaser_rtn_m)


def test_the_camera_points_at_where_the_chaser_believes_the_target_is(flown):
    """Off the true direction by the error of the estimate, and 0.05° of pointing error per axis."""
    record = load_flight(flown / "flight.npz")
    for labels, error in zip(Dataset(flown), record.r_true_rtn_m - record.r_rtn_m, strict=True):
        x, y, z = labels.t_body_cam_m
        off_rad = np.hypot(x, y) / z
        assert off_rad < 5 * np.radians(0.05) * np.sqrt(2) + 2 * np.linalg.norm(error) / z + 0.05


def test_killed_and_resumed_flights_are_equal_to_the_bit(posse_in, start_posse_in, flown, tmp_path):
    (tmp_path / "slow.yaml").write_text((SCENARIO + SENSORS).replace("seconds: 0", "seconds: 0.3"))
    with start_posse_in(tmp_path, "fly", "slow.yaml", "--out", "d") as process:
        readings = tmp_path / "d" / "readings.jsonl"
        while not (readings.exists() and readings.read_bytes().count(b"\n") >= 3):
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    with open(readings, "ab") as stream:
        stream.write(b'{"index": 3, "t_s"')  # as a kill within a write leaves it
    done = posse_in(tmp_path, "fly", "--resume", "--out", "d")
    assert done.returncode == 0, done.stderr
    there, wanted = digests(tmp_path / "d"), digests(flown)
    for name in ("scenario.yaml", "manifest.json"):  # they name the renderer's option
        there.pop(name), wanted.pop(name)
    assert there == wanted


def test_a_flight_whose_readings_are_lost_is_made_again_from_there(posse_in, flown, tmp_path):
    shutil.copytree(flown, tmp_path / "d")
    readings = tmp_path / "d" / "readings.jsonl"
    lines = readings.read_bytes().splitlines(keepends=True)
    readings.write_bytes(b"".join(lines[:4]) + lines[4][:50])
    done = posse_in(tmp_path, "fly", "--resume", "--out", "d")
    assert done.returncode == 0, done.stderr
    assert digests(tmp_path / "d") == digests(flown)


def test_many_seeds_are_the_flights_one_by_one(posse_in, flown, tmp_path):
    """Whatever the number of workers; seed 7 is the scenario's own."""
    (tmp_path / "small.yaml").write_text(SCENARIO + SENSORS)
    done = posse_in(tmp_path, "fly", "small.yaml", "--seeds", 3, "--workers", 2, "--out", "m", "--json")
    assert done.returncode == 0, done.stderr
    assert digests(tmp_path / "m" / "seed-007") == digests(flown)
    flights = json.loads(done.stdout)["flights"]
    assert [flight["seed"] for flight in flights] == [7, 8, 9]
    ends = [
        load_flight(tmp_path / "m" / f"seed-{s:03d}" / "flight.npz").r_true_rtn_m[-1] for s in (7, 8, 9)
    ]
    assert len({tuple(end) for end in ends}) == 3
    for flight, end in zip(flights, ends, strict=True):
        assert flight["final_range_m"] == pytest.approx(np.linalg.norm(end))
    again = posse_in(tmp_path, "fly", "--resume", "--out", "m", "--seeds", 3, "--json")
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout) == json.loads(done.stdout)


def test_dead_reckoning_is_off_by_the_start_error_and_the_truth_is_not(posse, tmp_path):
    (tmp_path / "small.yaml").write_text(SCENARIO)
    errors_m = {}
    for navigator in ("truth", "dead-reckoning"):
        done = posse("fly", "small.yaml", "--out", navigator, "-o", f"flight.navigator={navigator}")
        assert done.returncode == 0, done.stderr
        record = load_flight(tmp_path / navigator / "flight.npz")
        errors_m[navigator] = np.linalg.norm(record.r_true_rtn_m - record.r_rtn_m, axis=1)
    np.testing.assert_allclose(errors_m["truth"], 0, atol=1e-9)
    start_m = np.linalg.norm(record.r_true_rtn_m[0] - [2, -45, 5])
    assert errors_m["dead-reckoning"][0] == pytest.approx(start_m)
    assert start_m > 0.1


def test_a_flight_ends_early_where_the_scenario_says_so(posse, tmp_path):
    (tmp_path / "small.yaml").write_text(SCENARIO)
    done = posse("fly", "small.yaml", "--out", "near", "-o", "flight.end.below_m=44")
    assert done.returncode == 0, done.stderr
    record = load_flight(tmp_path / "near" / "flight.npz")
    range_m = np.linalg.norm(record.r_true_rtn_m, axis=1)
    assert range_m[-1] < 44 <= range_m[:-1].min()
    assert posse("validate", "near").returncode == 0


def test_in_eclipse_nothing_is_read_and_the_flight_ends_if_it_is_to(posse, tmp_path):
    (tmp_path / "small.yaml").write_text(SCENARIO)
    dark = ["-o", "orbit.elements.mean_anomaly_deg=135"]
    done = posse("fly", "small.yaml", "--out", "d", "-o", "flight.end.without_readings_s=30", *dark)
    assert done.returncode == 0, done.stderr
    record = load_flight(tmp_path / "d" / "flight.npz")
    np.testing.assert_array_equal(record.t_s, [0, 10, 20, 30])
    assert not record.dof.any()
    assert np.isnan(record.r_single_rtn_m).all()
    sigma_m = np.sqrt(record.covariance[:, 1, 1])
    assert np.all(np.diff(sigma_m) > 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["aqua"], "aqua: flight: missing"),
        (["small.yaml", "--frames", "3"], "--frames: a flight has a frame every flight.period_s"),
        (["small.yaml", "--workers", "2"], "--workers: one flight cannot be divided"),
        ([], "name a scenario to fly"),
        (["small.yaml", "-o", "propagator=thesis"], "propagator: 'thesis' cannot carry on"),
        (["small.yaml", "-o", "flight.goal=null"], "flight.goal: missing"),
        (["small.yaml", "-o", "flight.navigator=ekg"], "no navigator named 'ekg'; did you mean 'ekf'"),
        (["small.yaml", "-o", "flight.burn_after_s=10"], "burn_after_s is not below period_s"),
        (["small.yaml", "-o", "flight.duration_s=60"], "the goal reaches to 80 s"),
        (
            ["small.yaml", "-o", "relative={design: {name: hold-point, r_rtn_m: [0, -40, 0]}}"],
            "relative: a flight starts on one natural relative orbit",
        ),
        (["small.yaml", "-o", "flight.measurement.delay_s=-1"], "delay_s is negative"),
        (["small.yaml", "-o", "flight.safety={passive_s: 60}"], "passive_s needs keep_out_m"),
    ],
)
def test_bad_input_is_told_in_one_line(posse, tmp_path, arguments, message):
    (tmp_path / "small.yaml").write_text(SCENARIO)
    done = posse("fly", *arguments, "--out", "d") if arguments else posse("fly")
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "d").exists()
