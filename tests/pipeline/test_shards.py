"""The log of finished frames, cut and damaged in every way: it ends as if nothing had happened."""

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._dataset.remarks import Remark
from posse_core._files.atomic import sha256
from posse_core._files.store import LocalStore
from posse_core._model.label_line import LabelLine
from posse_core._run import shards
from posse_core._run.shards import CHECKSUMS, LabelLog

FRAMES = 13
PER_SHARD = 5
REMARKS = [None, *Remark]


@pytest.fixture(autouse=True)
def _short_shards(monkeypatch):
    monkeypatch.setattr(shards, "FRAMES_PER_SHARD", PER_SHARD)


def enter(log: LabelLog, folder: Path, index: int) -> None:
    """Write a frame's files, as a worker would, and enter it."""
    labels = LabelLine(
        index=index,
        spacecraft=f"größe {index}",
        image=f"images/{index:06d}.png",
        truth=f"truth/{index:06d}.npz" if index % 3 else None,
    )
    digests = {}
    for name in filter(None, (labels.image, labels.truth)):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(f"{name} {index**3}".encode())
        digests[name] = sha256(folder / name)
    log.append(labels, digests, REMARKS[index % len(REMARKS)])


def books(folder: Path) -> dict[str, bytes]:
    files = [folder / CHECKSUMS, *sorted((folder / "labels").iterdir())]
    return {path.name: path.read_bytes() for path in files}


def undisturbed(folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    log = LabelLog(folder, FRAMES)
    for index in range(FRAMES):
        enter(log, folder, index)
    before = books(folder)
    log.put_in_order()
    assert books(folder) == before
    return before


def damage(folder: Path, kind: str, data: st.DataObject) -> None:
    places = {
        "lose": "[it]*/*.*",
        "flip": "*/*.*",
        "cut": "*/*.*",
        "garble": "labels/*",
        "twice": "labels/*",
        "tear checksums": CHECKSUMS,
        "garble checksums": CHECKSUMS,
    }
    files = [path for path in sorted(folder.glob(places[kind])) if path.stat().st_size]
    if not files:
        return
    path = data.draw(st.sampled_from(files))
    whole = path.read_bytes()
    place = data.draw(st.integers(0, len(whole) - 1))
    if kind == "lose":
        path.unlink()
    elif kind in ("cut", "tear checksums"):
        path.write_bytes(whole[:place])
    elif kind == "flip":
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
    elif kind in ("garble", "garble checksums"):
        path.write_bytes(whole[:place] + b"\xff" + whole[place + 1 :])
    else:
        lines = whole.splitlines(keepends=True)
        path.write_bytes(whole + data.draw(st.sampled_from(lines)))


KINDS = ("lose", "flip", "cut", "garble", "twice", "tear checksums", "garble checksums")


@given(st.data())
def test_after_any_damage_the_books_are_the_same_to_the_bit(data):
    with tempfile.TemporaryDirectory() as place:
        expected = undisturbed(Path(place) / "whole")
        folder = Path(place) / "damaged"
        folder.mkdir()
        order = data.draw(st.permutations(range(FRAMES)))
        todo = order
        for _ in range(data.draw(st.integers(1, 3))):
            log = LabelLog(folder, FRAMES)
            done = log.recover(LocalStore(folder).sha256)
            todo = [index for index in order if index not in done]
            for index in todo[: data.draw(st.integers(0, FRAMES))]:
                enter(log, folder, index)
            for kind in data.draw(st.lists(st.sampled_from(KINDS), max_size=3)):
                damage(folder, kind, data)
        log = LabelLog(folder, FRAMES)
        done = log.recover(LocalStore(folder).sha256)
        for index in order:
            if index not in done:
                enter(log, folder, index)
        log.put_in_order()
        assert books(folder) == expected


@given(st.sets(st.integers(0, FRAMES - 1)))
def test_what_is_whole_is_not_made_again(entered):
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        log = LabelLog(folder, FRAMES)
        for index in entered:
            enter(log, folder, index)
        before = books(folder) if entered else {}
        assert LabelLog(folder, FRAMES).recover(LocalStore(folder).sha256) == entered
        assert (books(folder) if entered else {}) == before


def test_only_the_damaged_frame_is_made_again(tmp_path):
    folder = tmp_path / "d"
    undisturbed(folder)
    (tmp_path / "d/truth/000007.npz").write_bytes(b"")
    assert LabelLog(folder, FRAMES).recover(LocalStore(folder).sha256) == set(range(FRAMES)) - {7}
    rows = (tmp_path / "d" / CHECKSUMS).read_text()
    assert "000007" not in rows
    image = tmp_path / "d/images/000008.png"
    assert f"{sha256(image)}  images/000008.png\n" in rows
    lines = (tmp_path / "d/labels/shard-00001.jsonl").read_text().splitlines()
    assert [json.loads(line)["index"] for line in lines] == [5, 6, 8, 9]
