"""Parts are disjoint, of the right size, reproducible, and keep a sequence whole when asked."""

import csv
import json
from collections import Counter

import cuboid
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._cli.partition import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.validate import validate
from posse_core._selection.partition import partition


@given(
    st.integers(0, 400),
    st.tuples(*[st.integers(0, 100)] * 3).filter(any),
    st.integers(0, 2**40),
    st.data(),
)
def test_by_frame_every_frame_is_in_one_part_of_the_right_size(count, shares, seed, data):
    indices = np.array(sorted(data.draw(st.sets(st.integers(0, 5000), min_size=count, max_size=count))))
    indices = indices.astype(np.int64)
    parts = partition(indices, np.zeros_like(indices), shares, seed, "frame")
    assert sorted(i for members in parts.values() for i in members) == indices.tolist()
    for share, members in zip(shares, parts.values(), strict=True):
        assert abs(len(members) - share / sum(shares) * count) <= 1
        assert members == sorted(members)


@given(st.lists(st.integers(1, 40), min_size=3, max_size=60), st.integers(0, 2**40))
def test_by_sequence_none_is_divided_and_no_part_is_empty(sizes, seed):
    sequences = np.repeat(np.arange(len(sizes)), sizes)
    indices = np.arange(len(sequences))
    parts = partition(indices, sequences, (80, 10, 10), seed, "sequence")
    homes = [
        {part for part, members in parts.items() if set(members) & set(own)}
        for own in (indices[sequences == s].tolist() for s in range(len(sizes)))
    ]
    assert all(len(home) == 1 for home in homes)
    assert all(parts.values())
    assert sum(map(len, parts.values())) == len(indices)


def test_by_sequence_the_shares_are_met_where_sequences_are_small():
    sequences = np.repeat(np.arange(500), 4)
    parts = partition(np.arange(2000), sequences, (80, 10, 10), 1, "sequence")
    assert {part: len(members) for part, members in parts.items()} == pytest.approx(
        {"train": 1600, "valid": 200, "test": 200}, abs=4
    )


def test_the_shuffle_is_the_seeds_and_spreads_over_the_run():
    indices = np.arange(1000)
    one, again, other = (partition(indices, indices, (80, 10, 10), seed, "frame") for seed in (1, 1, 2))
    assert one == again
    assert one != other
    tenths = Counter(i // 100 for i in one["test"])
    assert len(tenths) == 10  # 100 draws leave a tenth out once in 4,000 times; the seed is fixed


def rows(path):
    with open(path, newline="") as stream:
        return list(csv.DictReader(stream))


def run(*arguments):
    return CliRunner().invoke(command, [str(a) for a in arguments])


def test_command_writes_the_six_lists_of_the_thesis(folder):
    result = run(folder, "--split", "50/25/25", "--seed", 4)
    assert result.exit_code == 0
    assert dict(line.split() for line in result.stdout.splitlines()) == {
        "train": "3",
        "valid": "1",
        "test": "2",
    }
    dataset, lines = Dataset(folder), cuboid.read_lines(folder)
    seen = []
    for part in ("train", "valid", "test"):
        names = [row["filename"] for row in rows(folder / f"partition/{part}_images.csv")]
        assert names == [lines[i]["image"] for i in dataset.part(part)]
        seen += names
        for row in rows(folder / f"partition/{part}_pose.csv"):
            label = next(line for line in lines if line["image"] == row["filename"])
            w, x, y, z = label["q_cam_from_body"]
            place = -Rotation.from_quat([x, y, z, w]).inv().apply(label["t_body_cam_m"])
            assert [float(row[f"camera_body_{a}_m"]) for a in "xyz"] == pytest.approx(place.tolist())
    assert sorted(seen) == [line["image"] for line in lines]
    before = {path.name: path.read_bytes() for path in (folder / "partition").iterdir()}
    run(folder, "--split", "50/25/25", "--seed", 4)
    assert {path.name: path.read_bytes() for path in (folder / "partition").iterdir()} == before
    with pytest.raises(InputError, match="no part 'val'; it has train, valid, test"):
        dataset.part("val")


def test_a_dataset_that_was_not_divided_says_how(folder):
    with pytest.raises(InputError, match="run 'posse partition'"):
        Dataset(folder).part("train")


@pytest.mark.parametrize("split", ["80/10", "80/10/ten", "0/0/0", "-1/1/1", "nan/1/1", "inf/1/1", ""])
def test_shares_that_are_none(folder, split):
    result = run(folder, "--split", split)
    assert isinstance(result.exception, InputError)
    assert "80/10/10" in str(result.exception)
    assert not (folder / "partition").exists()


@pytest.mark.parametrize("shares", [[80, 10], [80, 10, 10, 10], [0, 0, 0], [-1, 1, 1]])
def test_recorded_shares_that_are_none(folder, shares):
    run(folder)
    path = folder / "partition/partition.json"
    value = json.loads(path.read_text())
    path.write_text(json.dumps({**value, "shares": shares}))
    with pytest.raises(InputError, match=r"partition\.json: .*shares"):
        validate(Dataset(folder), lambda places, frames: places)


def test_too_few_sequences_for_the_parts(folder):
    result = run(folder, "--by", "sequence")
    assert isinstance(result.exception, InputError)
    assert "2 sequence(s) cannot be divided into 3 parts" in str(result.exception)
    assert run(folder, "--by", "sequence", "--split", "50/50/0").exit_code == 0


# Leakage, found by validation


def altered(folder, alter):
    run(folder, "--by", "sequence", "--split", "50/50/0")
    path = folder / "partition/partition.json"
    value = json.loads(path.read_text())
    alter(value["parts"])
    path.write_text(json.dumps(value))
    report = validate(Dataset(folder), lambda places, frames: places)
    result = next(result for result in report.results if result.name == "partition")
    return {(fault.frame, fault.message) for fault in result.faults}


def test_a_clean_partition_passes(folder):
    assert altered(folder, lambda parts: None) == set()


def test_a_frame_in_two_parts_leaks(folder):
    def alter(parts):
        parts["test"] = [parts["train"][0]]

    found = altered(folder, alter)
    assert any(message.endswith("is in train and in test") for _, message in found)


def test_a_sequence_in_two_parts_leaks(folder):
    def alter(parts):
        parts["test"] = [parts["train"].pop()]

    (found,) = altered(folder, alter)
    assert found[1].startswith("sequence")


def test_a_frame_in_no_part_and_one_that_is_not_there(folder):
    def alter(parts):
        parts["train"].remove(parts["train"][0])
        parts["test"] = [77]

    messages = {message for _, message in altered(folder, alter)}
    assert messages == {"is in no part", "is in a part, and not in the dataset"}
