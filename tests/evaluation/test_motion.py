"""Rates of joints against the values between which they move."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._evaluation.motion import JointState, rate_faults

TIMES_S = 10.0 * np.arange(9)


def states(values, rates, sequence=None):
    sequence = np.zeros(len(values), int) if sequence is None else sequence
    return [
        JointState(i, int(sequence[i]), float(TIMES_S[i]), float(values[i]), float(rates[i]))
        for i in range(len(values))
    ]


def found(*arguments):
    return [index for index, _ in rate_faults(states(*arguments))]


@given(st.floats(-1, 1), st.floats(1e-6, 0.1), st.sampled_from([-1, 1]))
def test_a_steady_joint_has_its_rate_and_no_other(start, rate, sign):
    values, rates = start + sign * rate * TIMES_S, np.full(9, sign * rate)
    assert found(values, rates) == []
    assert found(values, -rates) == [2, 3, 4, 5, 6]
    one = rates.copy()
    one[4] *= 1.05
    assert found(values, one) == [4]


@given(st.integers(0, 10**6))
def test_values_that_have_nothing_to_do_with_each_other_prove_no_rate(seed):
    assert found(np.random.default_rng(seed).uniform(-1, 1, 9), np.zeros(9)) == []


@pytest.mark.parametrize("amplitude", [0.01, 1.0])
def test_an_oscillation_that_is_seen_at_the_same_phase_has_any_rate(amplitude):
    rate = amplitude * 2 * np.pi / 10 * np.ones(9)
    assert found(np.full(9, 0.3), rate) == []


@given(st.floats(0.33, 3.0))
def test_angles_within_a_turn_may_hide_whole_turns(rate):
    values = np.angle(np.exp(1j * rate * TIMES_S))
    assert found(values, np.full(9, rate)) == []


def test_another_sequence_is_another_motion():
    values, rates = 0.01 * TIMES_S, np.full(9, -0.01)
    assert found(values, rates, np.arange(9) // 4) == []
