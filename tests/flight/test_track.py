"""``posse track``: against what white noise allows, against the flight itself, and bad input."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import run_posse
from small_flight import NATURAL, SCENARIO

import posse_core
from posse_core import Dataset
from posse_core._evaluation.flight import flight_errors
from posse_core._files.flight import load_flight, save_flight

WHITE = {
    "measurement.source": "truth",
    "measurement.sigma_px": 0.3,
    "navigator.bias_share": 0,
    "navigator.adaptive": False,
    "navigator.acceleration_m_s2_rthz": 0,
    "navigator.angular_acceleration_deg_s2_rthz": 0,
    "errors.camera_attitude_deg": 0,
    "errors.start.position_m": 10,
    "errors.start.velocity_m_s": 0.1,
}
"""True keypoints with white noise, exact dynamics, and a start that says little."""


def made(posse_in, folder: Path, scenario: str, command: str) -> Path:
    (folder / "small.yaml").write_text(scenario)
    done = posse_in(folder, command, "small.yaml", "--out", "d")
    assert done.returncode == 0, done.stderr
    return folder / "d"


@pytest.fixture(scope="module")
def natural(posse_in, tmp_path_factory) -> Path:
    """A natural motion. Tests must not change it."""
    return made(posse_in, tmp_path_factory.mktemp("natural"), NATURAL, "run")


@pytest.fixture(scope="module")
def flown(posse_in, tmp_path_factory) -> Path:
    """A flight. Tests must not change it."""
    return made(posse_in, tmp_path_factory.mktemp("flown"), SCENARIO, "fly")


@pytest.fixture(scope="module")
def white(natural):
    """The natural motion, tracked where all noise is white."""
    return posse_core.track(natural, overrides=WHITE)


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_all_frames_together_are_better_than_one_by_the_root_of_their_number(white):
    """The end of a straight line through N points of equal noise is known to 2/√N of it (Gelb 1974)."""
    errors, frames = flight_errors(white), len(white)
    gain = 2 / np.sqrt(frames)
    for first, ours, single in (
        (0, errors.r_rtn_m, np.linalg.norm(errors.r_single_rtn_m, axis=1)),
        (6, errors.attitude_rad, errors.single_rad),
    ):
        sigma = np.linalg.norm(errors.sigma[-1, first : first + 3])
        assert sigma < 1.2 * gain * rms(single)
        assert np.linalg.norm(ours[-1]) < 2 * sigma


def test_its_errors_are_as_its_covariance_says(white):
    errors = flight_errors(white)
    assert np.linalg.norm(errors.r_rtn_m[0]) < 30
    assert 12 - 5 * np.sqrt(24) < errors.nees_12[-1] < 12 + 5 * np.sqrt(24)


def test_the_same_bits_twice(natural, white):
    again = posse_core.track(Dataset(natural), overrides=WHITE)
    for name, array in white.arrays().items():
        np.testing.assert_array_equal(array, again.arrays()[name], err_msg=name)


def test_tracking_a_flight_again_reproduces_its_estimates(flown, tmp_path):
    """Readings, start, impulses and navigator are the flight's; positions go through the files, so they
    agree to rounding."""
    posse_core.track(flown, out=tmp_path / "t")
    flight, track = load_flight(flown / "flight.npz"), load_flight(tmp_path / "t" / "track.npz")
    assert np.any(flight.dv_rtn_m_s)
    for name in ("r_rtn_m", "v_rtn_m_s", "q_eci_from_body", "omega_body_rad_s", "r_single_rtn_m"):
        np.testing.assert_allclose(track.arrays()[name], flight.arrays()[name], atol=1e-8, err_msg=name)
    np.testing.assert_allclose(track.nis, flight.nis, rtol=1e-6)
    for name in ("t_s", "burn_s", "dv_commanded_rtn_m_s", "dv_rtn_m_s", "dof", "rejected"):
        np.testing.assert_array_equal(track.arrays()[name], flight.arrays()[name], err_msg=name)
    assert not len(track.t_waypoint_s)
    assert np.isnan(track.least_dv_m_s)


def test_a_navigator_that_the_scenario_cannot_have_is_told_by_the_dataset(flown, tmp_path):
    shutil.copytree(flown, tmp_path / "f")
    text = (tmp_path / "f" / "scenario.yaml").read_text()
    assert "navigator:\n" in text
    (tmp_path / "f" / "scenario.yaml").write_text(
        text.replace("navigator:\n", "navigator:\n    orbt: 1\n")
    )
    with pytest.raises(posse_core.InputError, match=r"/f: navigator.*orbt: unknown key"):
        posse_core.track(tmp_path / "f")


def test_a_dataset_whose_page_cannot_be_made_gets_no_record(flown, tmp_path):
    """The page alone reads the manifest and the pictures."""
    shutil.copytree(flown, tmp_path / "f")
    (tmp_path / "f" / "manifest.json").write_text("{}")
    with pytest.raises(posse_core.InputError, match=r"manifest\.json: .*: field required"):
        posse_core.track(tmp_path / "f", out=tmp_path / "new" / "t")
    assert not (tmp_path / "new").exists()


def test_the_navigator_is_told_of_a_flights_impulses(flown, tmp_path):
    """Without its record a flight is a motion without impulses: each moves the chaser by Δv times the
    time since, for so short a part of an orbit."""
    ignorant = tmp_path / "ignorant"
    shutil.copytree(flown, ignorant, ignore=lambda *_: ["flight.npz"])
    told, untold = (posse_core.track(folder, navigator="dead-reckoning") for folder in (flown, ignorant))
    since_s = np.maximum(told.t_s[-1] - told.burn_s, 0)
    moved_m = np.sum(told.dv_commanded_rtn_m_s * since_s[:, None], axis=0)
    assert np.linalg.norm(moved_m) > 1
    np.testing.assert_allclose(
        told.r_rtn_m[-1] - untold.r_rtn_m[-1], moved_m, atol=0.1 * np.linalg.norm(moved_m)
    )


def test_a_start_by_the_first_pose_knows_nothing_before_it(natural):
    overrides = WHITE | {"start": "first-pose"}
    track = posse_core.track(natural, overrides=overrides)
    np.testing.assert_allclose(track.r_rtn_m[0], track.r_single_rtn_m[0], rtol=1e-12)
    np.testing.assert_allclose(track.v_rtn_m_s[0], 0, atol=1e-15)
    assert track.dof[0] == 0
    errors = flight_errors(track)
    assert np.linalg.norm(errors.r_rtn_m[-1]) < 4 * np.linalg.norm(errors.sigma[-1, :3])
    assert np.linalg.norm(errors.r_rtn_m[-1]) < rms(errors.r_single_rtn_m)


def test_one_of_several_sequences(natural, tmp_path):
    """Its frames are taken by its number, and only they; the page shows them."""
    several = changed(natural, tmp_path / "d", sequence=lambda t_s: np.where(t_s < 400, 3, 8))
    code, _, error = run_posse("track", several)
    assert code == 2
    assert "d: has 2 sequences, 3 to 8; name one by --sequence" in error
    code, _, error = run_posse("track", several, "--sequence", 7)
    assert code == 2
    assert "--sequence 7: " in error
    assert "has the sequences 3 to 8" in error
    track = posse_core.track(several, sequence=8, out=tmp_path / "t", overrides=WHITE)
    dataset = Dataset(several)
    rows = np.flatnonzero(dataset.trajectory.t_s >= 400)
    np.testing.assert_array_equal(track.r_true_rtn_m, dataset.trajectory.r_chaser_rtn_m[rows])
    np.testing.assert_array_equal(track.t_s, dataset.trajectory.t_s[rows])
    assert (track.dof[1:] > 0).all()
    page = (tmp_path / "t" / "track.html").read_text()
    assert all((f'id="frame-{i}"' in page) == (i in rows) for i in range(len(dataset)))


def test_json_is_the_summary(natural, tmp_path):
    words = [word for key, value in WHITE.items() for word in ("-o", f"{key}={value}")]
    code, out, error = run_posse("track", natural, "--out", tmp_path / "t", "--json", *words)
    assert code == 0, error
    told = json.loads(out)
    assert (told["frames"], told["posed"]) == (60, 60)
    single = told["single_position_m"]
    assert told["position_m"]["median"] < single["median"] < single["percentile_95"]
    unread = ["--navigator", "dead-reckoning", "-o", "measurement.source=truth"]
    code, out, error = run_posse("track", natural, "--out", tmp_path / "t", "--json", *unread)
    assert code == 0, error
    assert json.loads(out)["rate_rad_s"] == {"median": None, "percentile_95": None}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: there is no such folder"),
        (["d", "--navigator", "ekg"], "no navigator named 'ekg'; did you mean 'ekf'"),
        (["d", "-o", "measurement.sauce=truth"], "option measurement.sauce: unknown key; did you mean"),
        (["d", "-o", "measurement.sigma_px=-1"], "option measurement.sigma_px: input should be greater"),
        (["d", "-o", "navigator.bias_shere=0"], "bias_shere: unknown key; did you mean 'bias_share'"),
        (["d", "-o", "errors.pointing_deg=1"], "option errors.pointing_deg: unknown key"),
        (["d", "-o", "measurement.boxes=no.onnx"], "no.onnx"),
        (["bare", "-o", "measurement.source=truth"], "add 'keypoints' to the scenario's annotators"),
        (["one", "-o", "measurement.source=truth", "--sequence", 4], "sequence 4 has 1 frame"),
        (["falls", "-o", "measurement.source=truth"], "trajectory.npz: the target"),
    ],
)
def test_bad_input_is_told_in_one_line(bad, arguments, message):
    dataset, *options = arguments
    code, _, error = run_posse("track", bad / dataset, *options, "--out", bad / "t")
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not (bad / "t").exists()


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("scenario.yaml", "[]", "scenario.yaml: holds a value, not keys"),
        ("scenario.yaml", "flight: 3", "scenario.yaml, line 1: flight: holds a value, not keys"),
        ("scenario.yaml", "flight: {navigator: ekg}", "no navigator named 'ekg'"),
        ("scenario.yaml", "seed: -1", "scenario.yaml, line 1: seed: input should be greater"),
        ("flight.npz", "nothing", "flight.npz: not the record of a flight"),
        ("trajectory.npz", "nothing", "trajectory.npz"),
    ],
)
def test_damaged_files_are_told_in_one_line(natural, tmp_path, file, content, message):
    shutil.copytree(natural, tmp_path / "d")
    (tmp_path / "d" / file).write_text(content)
    options = ["-o", "measurement.source=truth", "--out", tmp_path / "t"]
    code, _, error = run_posse("track", tmp_path / "d", *options)
    assert (code, error.count("\n")) == (2, 1), error
    assert message in error


def test_the_record_of_another_flight(flown, tmp_path):
    shutil.copytree(flown, tmp_path / "d")
    record = load_flight(flown / "flight.npz")
    save_flight(replace(record, burn_s=record.burn_s[:-1]), tmp_path / "d" / "flight.npz")
    code, _, error = run_posse("track", tmp_path / "d")
    assert (code, error.count("\n")) == (2, 1), error
    assert "flight.npz: not the record of the dataset's frames" in error


def test_a_model_that_does_not_know_the_spacecraft(natural, tmp_path):
    pytest.importorskip("posse_detect_onnx")
    other = changed(natural, tmp_path / "d")
    old, new = (other / "spacecraft" / f"{name}.json" for name in ("aqua", "kite"))
    new.write_text(old.read_text().replace('"aqua"', '"kite"'))
    old.unlink()
    code, _, error = run_posse("track", other, "--out", tmp_path / "t")
    assert code == 2
    assert "measurement: no shipped model finds kite; there are models of aqua" in error
    assert error.count("\n") == 1


@pytest.fixture(scope="module")
def bad(natural, tmp_path_factory) -> Path:
    """A folder with datasets: a good one, one without keypoints, one of a frame, one that falls."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "d").symlink_to(natural)
    changed(natural, folder / "bare", without="keypoints")
    changed(natural, folder / "one", sequence=lambda t_s: np.arange(len(t_s)))
    falls_m_s = 0.01 * Dataset(natural).trajectory.v_target_eci_m_s
    changed(natural, folder / "falls", v_target_eci_m_s=lambda _: falls_m_s)
    return folder


def changed(dataset: Path, folder: Path, without: str = "", **arrays) -> Path:
    """A copy of a dataset without a label, or with other arrays in its trajectory, by their times."""
    shutil.copytree(dataset, folder)
    for path in (folder / "labels").iterdir():
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        kept = [{key: line[key] for key in line if key != without} for line in lines]
        path.write_text("".join(f"{json.dumps(line)}\n" for line in kept))
    with np.load(folder / "trajectory.npz") as archive:
        there = dict(archive)
    new = {name: array(there["t_s"]) for name, array in arrays.items()}
    np.savez(folder / "trajectory.npz", **{**there, **new})
    return folder
