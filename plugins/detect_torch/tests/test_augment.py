"""Augmentation: labels go where the pixels go; light stays light."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core import random_generator
from posse_detect_torch import augment

SIZE = 96
CHANGES = [augment.coarsen, *(change for change, _ in augment._PROBABILITIES)]
seeds = st.integers(0, 2**31)


@given(seeds)
def test_a_box_goes_where_its_pixels_go(seed):
    random = np.random.default_rng(seed)
    x, y = random.integers(0, 60, 2)
    w, h = random.integers(8, 36, 2)
    picture = np.zeros((SIZE, SIZE), np.float32)
    picture[y : y + h, x : x + w] = 1
    view = augment.random_view(random, SIZE, (0.6, 1.5), 0.25, np.pi / 2 * random.integers(4))
    moved = augment.move_boxes(np.array([[x, y, x + w, y + h]], float), view, SIZE)[0]
    ys, xs = np.nonzero(augment.warp(picture, view, len(picture)) > 0.5)
    if min(moved[2:] - moved[:2]) < 2:
        return
    found = [xs.min(), ys.min(), xs.max() + 1, ys.max() + 1]
    np.testing.assert_allclose(found, moved, atol=1.01)


@given(seeds)
def test_a_point_goes_where_its_pixels_go(seed):
    random = np.random.default_rng(seed)
    view = augment.random_view(random, SIZE, (0.45, 1.2), 0.05, random.uniform(0, 2 * np.pi))
    v, u = np.mgrid[:SIZE, :SIZE]
    point = random.uniform(36, 60, 2)
    spot = np.exp(-((u + 0.5 - point[0]) ** 2 + (v + 0.5 - point[1]) ** 2) / 18).astype(np.float32)
    seen = augment.warp(spot, view, len(spot)).astype(float)
    found = np.array([((u + 0.5) * seen).sum(), ((v + 0.5) * seen).sum()]) / seen.sum()
    np.testing.assert_allclose(found, augment.move_points(point, view), atol=0.05)


@given(seeds, st.floats(0.05, 0.2), st.floats(0.05, 0.2))
def test_what_is_covered_keeps_its_shape_in_front_of_another_background(seed, light, behind):
    """Both have an exposure of their own; backgrounds are coded as the square root of their light."""
    random = np.random.default_rng(seed)
    covered = (random.uniform(size=(SIZE, SIZE)) < 0.5).astype(np.float32)
    picture = np.full((SIZE, SIZE), light, np.float32)
    backgrounds = np.full((1, 40, 40), round(255 * np.sqrt(behind)), np.uint8)
    made = next(
        made
        for made in (augment.in_front_of_some(picture, covered, backgrounds, random) for _ in range(99))
        if made is not picture
    )
    assert np.unique(made[covered == 1]).size == 1
    assert 0.25 <= made[covered == 1][0] / light <= 2.001
    assert np.ptp(made[covered == 0]) < 1e-6
    assert 0.23 <= made[covered == 0][0] / behind <= 2.1  # eight bits resolve 5 % of so little light


@given(seeds)
def test_what_covers_the_whole_square_leaves_no_light_below_nothing(seed):
    """Averages of shares of 1 may round to more, and a network takes the root of light."""
    random = np.random.default_rng(seed)
    view = augment.random_view(random, SIZE, (0.4, 0.7), 0.0, random.uniform(0, 2 * np.pi))
    covered = augment.warp(np.ones((3 * SIZE, 3 * SIZE), np.float32), view / 3, SIZE)
    dark, bright = np.zeros((SIZE, SIZE), np.float32), np.full((1, 40, 40), 255, np.uint8)
    for _ in range(4):
        made = augment.in_front_of_some(dark, covered, bright, random)
        assert 0 <= made.min() <= made.max() <= 1


def test_a_share_of_the_spacecraft_is_put_in_front_of_another_background():
    random = np.random.default_rng(0)
    picture, covered = (np.full((4, 4), x, np.float32) for x in (0.2, 1.0))
    made = [
        augment.in_front_of_some(picture, covered, np.ones((3, 8, 8), np.uint8), random) is picture
        for _ in range(2000)
    ]
    assert np.mean(made) == pytest.approx(1 - augment._COMPOSED, abs=0.04)
    none = np.ones((0, 8, 8), np.uint8)
    assert augment.in_front_of_some(picture, covered, none, random) is picture


@given(seeds)
def test_a_view_never_mirrors(seed):
    random = np.random.default_rng(seed)
    view = augment.random_view(random, SIZE, (0.6, 1.5), 0.2, random.uniform(0, 2 * np.pi))
    assert np.linalg.det(view[:, :2]) > 0


@pytest.mark.parametrize("change", CHANGES)
def test_changes_keep_range_and_their_input(change):
    for seed in range(5):
        random = np.random.default_rng(seed)
        picture = random.uniform(0, 0.4, (SIZE, SIZE)).astype(np.float32)
        before = picture.copy()
        changed = change(picture, random)
        assert changed.dtype == np.float32
        assert changed.shape == picture.shape
        assert 0 <= changed.min() <= changed.max() <= 1 + 1e-6
        assert not np.array_equal(changed, before)
        assert np.array_equal(picture, before)


def test_noise_grows_with_light():
    random = np.random.default_rng(0)
    spread = [
        np.mean([augment.noise(np.full((64, 64), x, np.float32), random).std() for _ in range(40)])
        for x in (0.1, 0.6)
    ]
    assert spread[1] > 1.3 * spread[0]


def test_the_same_generator_gives_the_same_picture():
    picture = np.random.default_rng(1).uniform(0, 1, (SIZE, SIZE)).astype(np.float32)
    a, b = (augment.change_appearance(picture, random_generator(3, 8, "augmentation")) for _ in range(2))
    assert np.array_equal(a, b)
