"""Even choices of indices."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from posse_core._arrays import evenly_spread


@given(total=st.integers(0, 5000), count=st.integers(0, 6000))
def test_an_even_choice_has_both_ends_and_no_gap_larger_than_it_must_be(total: int, count: int) -> None:
    chosen = evenly_spread(total, count).tolist()
    wanted = min(total, count)
    assert len(chosen) == len(set(chosen)) == wanted
    assert chosen == sorted(chosen)
    if wanted > 1:
        assert (chosen[0], chosen[-1]) == (0, total - 1)
        step = Fraction(total - 1, wanted - 1)
        assert all(
            abs(index - k * step) <= Fraction(1, 2) + Fraction(1, 10**9)
            for k, index in enumerate(chosen)
        )
    if count >= total:
        assert np.array_equal(chosen, np.arange(total))
