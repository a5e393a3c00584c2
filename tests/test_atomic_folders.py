"""Folders that are there as a whole or not at all, whatever happens to the processes that make them."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from posse_core._files.atomic import atomic_folder


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def killed_while_it_makes(folder: Path) -> None:
    """Another process is killed when it has written a file, and before it has ended."""
    ready, tell = os.pipe()
    process = os.fork()
    if not process:
        with atomic_folder(folder) as building:
            (building / "half").write_text("x")
            os.write(tell, b"x")
            signal.pause()
    os.read(ready, 1)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)


@pytest.mark.parametrize("is_there", [False, True])
def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path, is_there):
    folder = tmp_path / "e"
    if is_there:
        folder.mkdir()
    killed_while_it_makes(folder)
    assert any(name.endswith(".partial") for name in names(tmp_path))
    folder.mkdir(exist_ok=True)  # it may also have been killed later, when the folder was there
    with atomic_folder(folder) as building:
        (building / "whole").write_text("y")
    assert names(tmp_path) == {"e", "e/whole"}


def test_what_another_process_is_making_is_left_alone(tmp_path):
    folder = tmp_path / "e"
    with atomic_folder(folder) as building:
        (building / "mine").write_text("x")
        process = os.fork()
        if not process:
            with atomic_folder(folder) as own:
                (own / "theirs").write_text("y")
            os._exit(0)
        assert os.waitpid(process, 0)[1] == 0
        assert names(folder) >= {"theirs"}
        assert (building / "mine").read_text() == "x"
    assert names(tmp_path) == {"e", "e/mine", "e/theirs"}


def test_an_error_leaves_nothing(tmp_path):
    def fail() -> None:
        with atomic_folder(tmp_path / "e") as building:
            (building / "half").write_text("x")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert names(tmp_path) == set()


def test_folders_of_other_names_are_left_alone(tmp_path):
    other = tmp_path / ".f.abc.partial"
    other.mkdir()
    with atomic_folder(tmp_path / "e") as building:
        (building / "whole").write_text("y")
    assert names(tmp_path) == {"e", "e/whole", ".f.abc.partial"}
