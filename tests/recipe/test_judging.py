"""The evaluation takes as many frames as there is time for."""

from __future__ import annotations

import math
import time
from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._recipe.judging import LEAST_EVALUATED, in_time


@given(
    frames=st.integers(0, 300),
    seed=st.integers(0, 2**31),
    frame_s=st.floats(0.1, 100),
    left_s=st.floats(-1e4, 1e4),
)
def test_frames_are_begun_while_there_is_time(
    frames: int, seed: int, frame_s: float, left_s: float
) -> None:
    positions, now_s, taken = range(1000, 1000 + frames), 0.0, list[int]()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "monotonic", lambda: now_s)
        for position in in_time(positions, seed, left_s):
            taken.append(position)
            now_s += frame_s
    assert len(set(taken)) == len(taken)
    assert set(taken) <= set(positions)
    if len(taken) < frames:
        assert len(taken) >= LEAST_EVALUATED
        assert now_s >= left_s
    if len(taken) > LEAST_EVALUATED:
        assert now_s - frame_s < left_s


def test_those_that_are_taken_are_from_everywhere() -> None:
    """By 40 of 4000, a share of each quarter; the same by the same seed, however many there is time
    for."""
    taken = list(islice(in_time(range(4000), 7, math.inf), 40))
    quarters = [sum(1000 * k <= position < 1000 * (k + 1) for position in taken) for k in range(4)]
    assert min(quarters) >= 3  # by chance, fewer once in 600 seeds
    assert taken[:LEAST_EVALUATED] == list(in_time(range(4000), 7, 0.0))
