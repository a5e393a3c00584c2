"""What nothing foresaw ends in one line, with exit code 4 and a file of the details."""

import re
from pathlib import Path

import pytest
from command import run_posse
from small_run import BOX_OBJ

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


def test_a_line_that_repeats_a_long_value_is_cut_in_its_middle(tmp_path):
    (tmp_path / "s.yaml").write_text("target: {name: aqua}\n? " + "x" * 5000 + "\n: 1\n")
    code, _, error = run_posse("run", tmp_path / "s.yaml", "--out", tmp_path / "d")
    assert code == 2
    (line,) = error.splitlines()
    assert line.startswith(f"posse: {tmp_path}/s.yaml, line ")
    assert " ... " in line
    assert len(line) < 1300


def test_arithmetic_that_overflows_is_told_by_what_is_wrong_alone(monkeypatch, tmp_path):
    monkeypatch.delenv("POSSE_SHOW_FAULTS")
    (tmp_path / "box.obj").write_text(BOX_OBJ.replace("v 2 1 1", "v 2 1e308 1"))
    code, _, error = run_posse("import", tmp_path / "box.obj", "--out", tmp_path / "p", "--scale", "1")
    assert code == 2
    (line,) = error.splitlines()
    assert "a spacecraft is 0.01 … 1000 m long" in line


def test_a_path_that_cannot_be_used_is_bad_input(tmp_path):
    code, _, error = run_posse("view", tmp_path / ("x" * 300))
    assert code == 2
    assert "File name too long" in error
    assert len(error.splitlines()) == 1


def test_the_codes_are_told():
    assert "4 a fault of POSSE" in run_posse("--help")[1].replace("\n ", "")
