"""Runs to an S3-compatible server on loopback end in what runs to a folder end in."""

import json
import signal
import time
from pathlib import Path

import pytest

from posse_core._files.store import RemoteStore
from posse_core._run import lease
from posse_core._run.lease import LOCK, Lease

URL = "s3://bucket/sets/box"


@pytest.fixture
def bucket(server, refusing):
    """An empty bucket's file system."""
    refusing.unlink(missing_ok=True)
    server.mkdir("bucket")
    yield server
    refusing.unlink(missing_ok=True)
    server.rm("bucket", recursive=True)


def contents(server) -> dict[str, bytes]:
    root = URL.removeprefix("s3://")
    return {path.removeprefix(f"{root}/"): data for path, data in server.cat(server.find(root)).items()}


def assert_the_same(server, undisturbed: Path) -> None:
    """All files of an undisturbed run, to the bit, and no other; the mark of time is in none."""
    expected = {
        path.relative_to(undisturbed).as_posix(): path.read_bytes()
        for path in undisturbed.rglob("*")
        if path.is_file()
    }
    assert contents(server) == expected


def wait_for(server, process, pattern: str, files: int) -> None:
    while len(server.glob(f"{URL}/{pattern}")) < files:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)


@pytest.mark.parametrize("executor", ["local"])
def test_a_run_to_a_bucket_is_that_to_a_folder(executor, bucket, undisturbed, posse, small_scenario):
    made = posse("run", small_scenario, "--out", URL, "--json", "--executor", executor)
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout.splitlines()[0])["dataset"] == URL
    assert_the_same(bucket, undisturbed)
    again = posse("run", small_scenario, "--out", URL)
    assert again.returncode == 2
    assert "contains another run" in again.stderr
    bucket.pipe_file(f"{URL}/images/000003.png", b"")
    bucket.rm_file(f"{URL}/truth/000005.npz")
    mended = posse("run", "--resume", "--out", URL)
    assert mended.returncode == 0, mended.stderr
    assert "2 frames made of 8" in mended.stdout
    assert_the_same(bucket, undisturbed)


def test_a_refusing_store_is_one_line_and_the_run_goes_on_later(
    bucket, refusing, undisturbed, posse, start_posse, small_scenario
):
    slow = ("-o", "renderer.seconds=0.3")
    with start_posse("run", small_scenario, "--out", URL, *slow) as process:
        wait_for(bucket, process, "images/*", 3)
        refusing.touch()
        _, said = process.communicate(timeout=300)
    assert process.returncode == 3
    assert "Traceback" not in said
    assert said.strip().splitlines()[-1] == (
        f"posse: {URL}: cannot be written to (the quota is used up);"
        " continue with --resume: the frames made so far are kept"
    )
    refusing.unlink()
    assert posse("run", "--resume", "--out", URL).returncode == 0
    labels = {name: data for name, data in contents(bucket).items() if name != "scenario.yaml"}
    assert labels["labels/shard-00000.jsonl"] == (undisturbed / "labels/shard-00000.jsonl").read_bytes()
    assert labels["checksums.sha256"] == (undisturbed / "checksums.sha256").read_bytes()
    assert not [name for name in labels if name.startswith(".")]


def test_a_killed_run_is_resumed_and_a_living_one_left_alone(
    bucket, undisturbed, posse, start_posse, small_scenario, tmp_path
):
    arguments = ("run", small_scenario, "--out", URL, "-o", "renderer.seconds=1.5")
    with start_posse(*arguments, env={"FLAT_HANG_ONCE": f"6,{tmp_path / 'hung'}"}) as process:
        wait_for(bucket, process, ".journal/*", 1)
        refused = posse("run", "--resume", "--out", URL)
        assert refused.returncode == 2, refused.stderr
        assert "another run is writing" in refused.stderr
        process.send_signal(signal.SIGKILL)
    resumed = posse("run", "--resume", "--out", URL)
    assert resumed.returncode == 0, resumed.stderr
    assert "made of 8" in resumed.stdout
    assert "8 frames made of 8" not in resumed.stdout
    names = ("labels/shard-00000.jsonl", "checksums.sha256", "coco.json", "speed.json")
    made = contents(bucket)
    assert {name: made[name] for name in names} == {
        name: (undisturbed / name).read_bytes() for name in names
    }
    assert not [name for name in made if name.startswith(".")]


def test_what_cannot_be_is_refused_before_a_frame_is_made(bucket, posse, small_scenario):
    refused = posse("run", small_scenario, "--out", URL, "-o", "writers=[bop]")
    assert refused.returncode == 2
    assert "'bop' reads images" in refused.stderr
    missing = posse("run", small_scenario, "--out", "s3://no-such-bucket/d")
    assert missing.returncode == 3
    assert "no such bucket" in missing.stderr
    unknown = posse("run", small_scenario, "--out", "gopherfs://d")
    assert unknown.returncode == 2
    assert "gopherfs" in unknown.stderr
    bucket.pipe_file(f"{URL}/holiday.jpg", b"sun")
    foreign = posse("run", small_scenario, "--out", URL)
    assert foreign.returncode == 2
    assert "contains no run" in foreign.stderr
    assert contents(bucket) == {"holiday.jpg": b"sun"}


def test_a_lock_that_is_taken_ends_its_holder(bucket, monkeypatch):
    monkeypatch.setattr(lease, "RENEW_S", 0.1)
    monkeypatch.setattr(lease, "PATIENCE_S", 0.5)
    store = RemoteStore(URL)
    with Lease(store) as mine:
        mine.check()
        store.write(LOCK, b"another 7\n")
        deadline = time.monotonic() + 30
        while not mine._taken:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        with pytest.raises(lease.InputError, match="another run has taken over"):
            mine.check()
    assert store.read(LOCK) == b"another 7\n"
    with Lease(store):  # the other one gives no sign of life
        pass
    assert store.names() == []
