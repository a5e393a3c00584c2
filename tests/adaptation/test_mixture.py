"""What is learned from: the recipe's frames as they are, and other images as they are labelled."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

import cuboid
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._adaptation.adapt import divided
from posse_core._adaptation.mixture import MOST_REPEATS, Mixture, check_alike
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._formats.speed_images import SpeedImages
from posse_core._selection.partition import write_partition


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A hundred frames in parts of 80, 10 and 10."""
    folder = cuboid.repeat(cuboid.write_dataset(tmp_path_factory.mktemp("own") / "d"), 100)
    write_partition(Dataset(folder), (80, 10, 10), 0, "frame")
    return Dataset(folder)


@pytest.fixture(scope="module")
def target(tmp_path_factory: pytest.TempPathFactory) -> SpeedImages:
    """Five images with poses alone, in the format of SPEED+."""
    made = Dataset(cuboid.write_dataset(tmp_path_factory.mktemp("target") / "d"))
    folder = tmp_path_factory.mktemp("speed")
    shutil.copy(made.folder / "camera.json", folder)
    shutil.copytree(made.folder / "images", folder / "images")
    entries = [
        f'{{"filename": "{Path(x.image).name}", "q_vbs2tango_true": {list(x.q_cam_from_body)},'
        f' "r_Vo2To_vbs_true": {list(x.t_body_cam_m)}}}'
        for x in made[:5]
    ]
    (folder / "train.json").write_text(f"[{', '.join(entries)}]")
    return SpeedImages(folder / "train.json", cuboid.cuboid(), None)


@given(
    learned=st.lists(st.integers(0, 4), min_size=1, max_size=5, unique=True),
    share=st.floats(0.01, 0.9),
)
def test_images_have_their_share_and_are_repeated_evenly(
    own: Dataset, target: SpeedImages, learned: list[int], share: float
) -> None:
    mixture = Mixture(own, target, learned, share)
    train = mixture.part("train")
    assert train[:80] == own.part("train")
    counts = Counter(mixture[i].image for i in train[80:])
    assert set(counts) == {target[i].image for i in learned}
    assert max(counts.values()) - min(counts.values()) <= 1
    assert min(counts.values()) >= 1
    assert max(counts.values()) <= MOST_REPEATS
    if min(counts.values()) > 1 and max(counts.values()) < MOST_REPEATS:
        assert (len(train) - 80) / len(train) == pytest.approx(share, abs=1 / len(train))


def test_labels_and_images_are_those_given_and_other_parts_are_the_recipes(
    own: Dataset, target: SpeedImages
) -> None:
    mixture = Mixture(own, target, [3, 1], 0.1)
    for part in ("valid", "test"):
        assert mixture.part(part) == own.part(part)
    for i in range(len(mixture)):
        assert mixture[i].index == i == mixture.position(i)
    for i in (0, 57, 99):
        assert {**mixture[i].as_json(), "index": None} == {**own[i].as_json(), "index": None}
        assert np.array_equal(mixture.image(i), own.image(i))
    shown = [mixture[i].image for i in range(100, len(mixture))]
    for i, name in enumerate(shown, 100):
        given_as = next(line for line in target if line.image == name)
        assert {**mixture[i].as_json(), "index": None} == {**given_as.as_json(), "index": None}
        assert np.array_equal(mixture.image(i), target.image(given_as.index))
        assert mixture.size_px(i) == target.size_px(given_as.index)
    assert mixture[-1] == mixture[len(mixture) - 1]
    assert np.array_equal(mixture.image(-len(mixture)), own.image(0))


def test_the_hash_follows_what_is_learned_from(own: Dataset, target: SpeedImages) -> None:
    hashes = {
        Mixture(own, target, learned, share).sha256
        for learned, share in (([0, 1], 0.25), ([0, 2], 0.25), ([0, 1], 0.1))
    }
    assert len({own.sha256, *hashes}) == 4
    assert Mixture(own, target, [0, 1], 0.25).sha256 in hashes


def test_images_of_another_spacecraft_or_with_other_keypoints_are_refused(
    own: Dataset, target: SpeedImages, tmp_path: Path
) -> None:
    check_alike(own, target)
    other = Dataset(cuboid.write_dataset(tmp_path / "other", (("plate", cuboid.HALF),)))
    with pytest.raises(InputError, match="shows 'plate', and the nets know brick"):
        check_alike(own, other)
    larger = Dataset(cuboid.write_dataset(tmp_path / "larger", (("brick", 1.01 * cuboid.HALF),)))
    with pytest.raises(InputError, match="keypoint B1 of brick is elsewhere"):
        check_alike(own, larger)
    file = other.folder / "spacecraft" / "plate.json"
    (other.folder / "spacecraft" / "brick.json").write_text(
        file.read_text().replace('"plate"', '"brick"').replace('"B1"', '"B9"')
    )
    for ending in (".json", ".ply"):
        (other.folder / "spacecraft" / f"plate{ending}").unlink()
    with pytest.raises(InputError, match="brick has other keypoints"):
        check_alike(own, Dataset(other.folder))


def test_labelled_images_are_divided_by_their_parts_or_at_random(
    own: Dataset, target: SpeedImages
) -> None:
    assert divided(own, 0) == (own.part("train"), own.part("test"))
    learned, held_out = divided(target, 3)
    assert sorted(learned + held_out) == list(range(5))
    assert len(held_out) == 1
    assert divided(target, 3) == (learned, held_out)
    assert len({tuple(divided(target, seed)[1]) for seed in range(20)}) > 1
