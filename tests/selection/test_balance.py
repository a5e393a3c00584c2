"""Balance: a subset, even where the supply allows, the same for the same seed; bins against SciPy."""

import json
import math
from collections import Counter

import cuboid
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._cli.collect import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.validate import validate
from posse_core._model.label_line import LabelLine
from posse_core._selection.balance import AXES, BANDS, SECTORS, balanced

bins_of_frames = st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 3)), max_size=120)


@given(bins_of_frames, st.none() | st.integers(1, 150), st.integers(0, 2**40))
def test_a_subset_even_where_the_supply_allows(bins, frames, seed):
    kept = balanced(bins, frames, seed)
    assert kept == sorted(set(kept))
    assert set(kept) <= set(range(len(bins)))
    there, left = Counter(bins), Counter(bins[place] for place in kept)
    if frames is None:
        assert set(left) == set(there)
        assert all(left[name] == min(there.values()) for name in there)
    else:
        assert len(kept) == min(frames, len(bins))
        most = max(left.values(), default=0)
        assert all(left[name] >= most - 1 or left[name] == there[name] for name in there)
    assert kept == balanced(bins, frames, seed)


def test_the_seed_chooses_and_no_frame_is_preferred():
    bins = [("a",)] * 10 + [("b",)] * 3
    chosen = Counter(place for seed in range(2000) for place in balanced(bins, None, seed))
    assert set(chosen) == set(range(13))
    # Binomial, p = 0.3: a deviation of 20.5; five of them.
    assert all(abs(chosen[place] - 600) < 103 for place in range(10))
    odd = Counter(bins[place] for seed in range(400) for place in balanced(bins, 5, seed))
    assert abs(odd[("a",)] - 1000) < 50  # the odd frame falls to either bin: deviation 10


@given(st.floats(0.01, 1e6))
def test_ranges_lie_in_their_bin_of_half_an_octave(range_m):
    axis = AXES["range"]
    low, high = (
        2 ** (axis.bin_of(LabelLine(index=0, range_m=range_m)) / 2),
        2 ** (axis.bin_of(LabelLine(index=0, range_m=range_m)) / 2 + 0.5),
    )
    assert low <= range_m * (1 + 1e-12)
    assert range_m < high * (1 + 1e-12)


R = Rotation.random(random_state=1)


def labels_from(direction_body):
    """A camera on that side of the craft, turned anyhow."""
    x, y, z, w = R.as_quat()
    t = -R.apply(7.0 * direction_body)
    return LabelLine(index=0, q_cam_from_body=(w, x, y, z), t_body_cam_m=t.tolist(), range_m=7.0)


def test_directions_fill_bins_of_equal_area_that_are_what_their_names_say():
    axis = AXES["direction"]
    random = np.random.default_rng(5)
    directions = random.normal(size=(3200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = [axis.bin_of(labels_from(direction)) for direction in directions]
    counts = Counter(found)
    assert sorted(counts) == list(range(BANDS * SECTORS))
    # 3200/32 each, a deviation of 9.8; five of them.
    assert all(abs(count - 100) < 50 for count in counts.values())
    for direction, number in zip(directions[:300], found, strict=False):
        words = axis.name_of(number).replace(",", "").split()
        latitude = math.degrees(math.asin(direction[2]))
        longitude = math.degrees(math.atan2(direction[1], direction[0])) % 360
        assert float(words[1]) - 0.5 <= latitude <= float(words[3]) + 0.5
        assert float(words[5]) <= longitude <= float(words[7])


@pytest.mark.parametrize("axis", np.concatenate([np.eye(3), -np.eye(3)]))
def test_cameras_on_an_axis_have_a_bin(axis):
    assert 0 <= AXES["direction"].bin_of(labels_from(axis)) < BANDS * SECTORS


def run(*arguments):
    return CliRunner().invoke(command, [str(a) for a in arguments])


@pytest.fixture
def crafts(tmp_path):
    """Six frames of a brick; four of a plate."""
    plate = cuboid.write_dataset(tmp_path / "plate", (("plate", np.array([2.0, 1.0, 0.1])),))
    run(plate, "--out", tmp_path / "four", "--balance", "class", "--frames", 4)
    return cuboid.write_dataset(tmp_path / "brick"), tmp_path / "four"


def test_command_balances_classes_and_says_so(crafts, tmp_path):
    result = run(*crafts, "--out", tmp_path / "even", "--balance", "class", "--json")
    assert json.loads(result.stdout) == {"balance": 2, "kept": 8}
    even = Dataset(tmp_path / "even")
    assert Counter(frame.spacecraft for frame in even) == {"brick": 4, "plate": 4}
    assert validate(even, lambda places, frames: places).passed
    (entry,) = even.manifest.selection
    assert entry.model_dump() == {
        "rule": "balance",
        "why": "even over class (seed 0)",
        "dropped": 2,
        "bins": [
            {"class": "brick", "frames": 6, "kept": 4},
            {"class": "plate", "frames": 4, "kept": 4},
        ],
    }


def test_rules_go_before_balance_and_bins_are_crossed(crafts, tmp_path):
    options = ("--drop", "few-keypoints", "--balance", "range", "--balance", "class", "--seed", 3)
    result = run(*crafts, "--out", tmp_path / "even", *options, "--frames", 7)
    # The last frame of the brick shows nothing, and so may one of the plate's.
    assert result.exit_code == 0, result.exception
    rule, balance = Dataset(tmp_path / "even").manifest.selection
    assert rule.rule == "few-keypoints"
    assert rule.dropped >= 1
    assert balance.why == "7 frames, as even as possible over class, range (seed 3)"
    assert sum(each["kept"] for each in balance.bins) == 7
    assert sum(each["frames"] for each in balance.bins) == 7 + balance.dropped
    assert all(set(each) == {"class", "range", "frames", "kept"} for each in balance.bins)


def test_the_same_seed_takes_the_same_frames(crafts, tmp_path):
    origins = []
    for name, seed in (("a", 1), ("b", 1), ("c", 3)):
        options = ("--balance", "class", "--frames", 3, "--seed", seed)
        run(*crafts, "--out", tmp_path / name, *options)
        origins.append([frame.origin for frame in Dataset(tmp_path / name)])
    assert origins[0] == origins[1] != origins[2]


def test_refusals(crafts, tmp_path):
    brick, _ = crafts
    lines = cuboid.read_lines(brick)
    del lines[2]["range_m"]
    cuboid.write_lines(brick, lines)
    for options, words in (
        (("--balance", "clas"), "cannot balance by 'clas'; did you mean 'class'?"),
        (("--frames", 3), "--frames is for --balance only"),
        (("--balance", "range"), "frame 2 has no 'range_m', which balancing by range needs"),
    ):
        result = run(brick, "--out", tmp_path / "new", *options)
        assert isinstance(result.exception, InputError)
        assert words in str(result.exception)
        assert not (tmp_path / "new").exists()
