"""What nothing foresaw ends in one line, with exit code 4 and a file of the details."""

import re
from pathlib import Path

import pytest
from command import run_posse

from posse_core._dataset import dataset


@pytest.fixture
def _failing(monkeypatch):
    def fail(folder):
        raise KeyError(f"lost\n{folder}")

    monkeypatch.setattr(dataset, "Dataset", fail)


@pytest.mark.usefixtures("_failing")
def test_an_unforeseen_error_is_one_line_and_a_file(monkeypatch):
    monkeypatch.delenv("POSSE_SHOW_FAULTS")
    code, _, error = run_posse("view", "some-folder")
    assert code == 4
    (line,) = error.splitlines()
    assert line.startswith("posse: this is a fault of POSSE (KeyError: ")
    details = Path(re.search(r"details are in (\S+):", line)[1])
    text = details.read_text()
    details.unlink()
    assert "Traceback" in text
    assert "in fail" in text


@pytest.mark.usefixtures("_failing")
def test_the_details_are_shown_at_will(monkeypatch):
    monkeypatch.setenv("POSSE_SHOW_FAULTS", "1")
    with pytest.raises(KeyError, match="some-folder"):
        run_posse("view", "some-folder")


def test_the_details_need_no_room(monkeypatch, tmp_path):
    def fail(folder):
        raise RuntimeError("lost")

    monkeypatch.setattr(dataset, "Dataset", fail)
    monkeypatch.delenv("POSSE_SHOW_FAULTS")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    code, _, error = run_posse("view", "some-folder")
    assert code == 4
    assert "set POSSE_SHOW_FAULTS=1" in error


def test_a_path_that_cannot_be_used_is_bad_input(tmp_path):
    code, _, error = run_posse("view", tmp_path / ("x" * 300))
    assert code == 2
    assert "File name too long" in error
    assert len(error.splitlines()) == 1


def test_the_codes_are_told():
    assert "4 a fault of POSSE" in run_posse("--help")[1].replace("\n ", "")
