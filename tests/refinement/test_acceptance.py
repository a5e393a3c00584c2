"""What a search ends at is accepted, or confirms a start, as docs/refining.md says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._refinement.acceptance import has_fallen, is_confirming, is_likely, is_plausible
from posse_core._refinement.placement import Placement

SHARES = st.floats(0, 1)
FIRST = Placement(np.eye(3), np.array([0.0, 0.0, 10.0]))


@given(SHARES, SHARES)
def test_far_from_a_start_a_pose_needs_a_fifth_and_half_of_the_trust(
    certainty: float, trust: float
) -> None:
    assert is_likely(certainty, trust) == (certainty >= 0.2 and 2 * certainty >= trust)


@given(SHARES, SHARES)
def test_what_is_hardly_certain_or_agrees_little_confirms_nothing(
    agreement: float, certainty: float
) -> None:
    assert is_confirming(agreement, certainty) == (agreement >= 0.5 and certainty >= 0.2)


@given(SHARES, SHARES)
def test_a_tenth_of_the_disagreement_must_go(before: float, after: float) -> None:
    assert has_fallen(before, after) == (1 - after < 0.9 * (1 - before))
    assert not has_fallen(before, before)


@pytest.mark.parametrize(
    ("turn_deg", "range_m", "agreement", "before", "expected"),
    [
        (29, 10, 0.60, 0.5, True),
        (31, 10, 0.60, 0.5, False),
        (0, 12.9, 0.60, 0.5, True),
        (0, 13.1, 0.60, 0.5, False),
        (0, 10, 0.54, 0.2, False),
        (0, 10, 0.60, 0.59, False),
    ],
)
def test_outlines_alone_are_believed_near_their_start(
    turn_deg: float, range_m: float, agreement: float, before: float, expected: bool
) -> None:
    turn = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    found = Placement(turn, np.array([0.0, 0.0, range_m]))
    assert is_plausible(found, agreement, FIRST, before) is expected
