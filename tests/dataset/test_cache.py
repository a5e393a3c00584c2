"""The cache of arrays: complete files only, by what they were made of, and none that could run code."""

import threading
from pathlib import Path

import numpy as np
import pytest

from posse_core._files.cache import cached_array
from posse_core._files.cache_folder import cache_folder


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "posse"


def _counting(made: list[int], value: int = 1):
    def make() -> np.ndarray:
        made.append(value)
        return np.full((30, 40), value, np.uint8)

    return make


def test_an_array_is_made_once(folder: Path) -> None:
    made: list[int] = []
    arrays = [cached_array("map", [b"a", b"b"], _counting(made)) for _ in range(3)]
    assert made == [1]
    for array in arrays:
        np.testing.assert_array_equal(array, np.ones((30, 40)))
    assert cache_folder() == folder
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("parts", [[b"a", b"c"], [b"ab"], [b"b", b"a"], []])
def test_another_content_is_another_array_and_replaces_it(folder: Path, parts: list[bytes]) -> None:
    made: list[int] = []
    cached_array("map", [b"a", b"b"], _counting(made))
    assert cached_array("map", parts, _counting(made, 2)).max() == 2
    cached_array("other", [b"a", b"b"], _counting(made, 3))
    assert made == [1, 2, 3]
    assert sorted(path.name.split("-")[0] for path in folder.iterdir()) == ["map", "other"]


@pytest.mark.parametrize("damage", [b"", b"no array", "short", "pickle"])
def test_a_damaged_file_is_made_anew(folder: Path, damage) -> None:
    made: list[int] = []
    cached_array("map", [b"a"], _counting(made))
    (path,) = folder.iterdir()
    if damage == "short":
        path.write_bytes(path.read_bytes()[:-7])
    elif damage == "pickle":
        np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    else:
        path.write_bytes(damage)
    for _ in range(2):
        np.testing.assert_array_equal(cached_array("map", [b"a"], _counting(made)), np.ones((30, 40)))
    assert made == [1, 1]


def test_where_nothing_can_be_written_nothing_is_kept(folder: Path) -> None:
    folder.parent.mkdir()
    folder.write_text("a file in place of the folder")
    made: list[int] = []
    for _ in range(2):
        cached_array("map", [b"a"], _counting(made))
    assert made == [1, 1]


def test_many_at_a_time_get_the_same_array(folder: Path) -> None:
    found: list[np.ndarray] = []
    start = threading.Barrier(8)

    def work() -> None:
        start.wait()
        found.append(cached_array("map", [b"a"], lambda: np.arange(10**6)))

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    for array in found:
        np.testing.assert_array_equal(array, np.arange(10**6))
    assert len(list(folder.iterdir())) == 1
