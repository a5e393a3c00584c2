"""The distribution of samples over pixels against the closed form of Neyman allocation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from posse_render_mitsuba.samples import allot, further_rounds, mean_of_samples

SHAPE = (9, 11)
variances = arrays(float, SHAPE, elements=st.floats(0, 1e6, allow_subnormal=False))
CRAFT = np.ones(SHAPE)


@given(variances, st.integers(0, SHAPE[0] - 1), st.integers(0, SHAPE[1] - 1), st.floats(0, 1e6))
def test_a_pixels_own_variance_does_not_change_its_rank(variance, row, column, other):
    """Otherwise the image would be biased dark.

    The pixel's own variance changes only the common factor, so its rank among pixels that do not
    neighbour it stays."""
    changed = variance.copy()
    changed[row, column] = other
    far = np.ones(SHAPE, dtype=bool)
    far[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3] = False
    far[row, column] = True
    before, after = further_rounds(variance, CRAFT, 4)[far], further_rounds(changed, CRAFT, 4)[far]
    order = np.argsort(before, kind="stable")
    assert (np.diff(after[order])[np.diff(before[order]) > 1] >= -1).all()


@given(variances, st.floats(1.5, 20))
def test_all_rounds_are_spent_where_there_is_noise(variance, rounds):
    found = further_rounds(variance, CRAFT, rounds)
    assert found.min() >= 0
    if np.count_nonzero(variance) >= 20:
        assert found.mean() + 1 == pytest.approx(rounds, abs=0.51)


def test_a_pixel_twice_as_noisy_gets_twice_the_samples():
    variance = np.ones((40, 40))
    variance[:, 20:] = 4.0
    rounds = further_rounds(variance, np.ones((40, 40)), 12) + 1
    assert rounds[20, 5] == 8
    assert rounds[20, 35] == 16


def test_no_rounds_are_spent_on_empty_space():
    covered, variance = np.zeros((30, 30)), np.zeros((30, 30))
    covered[10:12, 10:12] = variance[10:12, 10:12] = 1.0
    rounds = further_rounds(variance, covered, 3)
    assert (rounds[8:14, 8:14] > 0).any()
    rounds[8:14, 8:14] = 0
    assert not rounds.any()


def test_without_noise_one_round_is_enough():
    assert not further_rounds(np.zeros(SHAPE), CRAFT, 4).any()


def test_the_mean_of_no_samples_is_nan():
    sums = np.array([[[2.0, 4.0, 6.0, 2.0], [0.0, 0.0, 0.0, 0.0]]])
    found = mean_of_samples(sums, np.array([[2.0, 0.0]]))
    np.testing.assert_array_equal(found, [[[1.0, 2.0, 3.0, 1.0], [np.nan] * 4]])


@given(arrays(float, 30, elements=st.floats(1e-3, 1e3)), st.floats(2, 20))
def test_an_allocation_keeps_its_limits_and_its_average(deviation, rounds):
    found = allot(deviation, rounds, least=2, most=16 * rounds)
    assert found.min() >= 2
    assert found.max() <= np.rint(16 * rounds)
    assert found.mean() == pytest.approx(rounds, abs=0.51)
    assert (np.diff(found[np.argsort(deviation)]) >= 0).all()
