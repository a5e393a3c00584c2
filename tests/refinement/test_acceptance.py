"""What a search ends at is accepted, or confirms a start, as docs/refining.md says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._interfaces.detector import PoseEstimate
from posse_core._refinement.acceptance import has_fallen, is_confirming, is_likely, is_plausible
from posse_core._refinement.placement import Placement

SHARES = st.floats(0, 1)
FIRST = Placement(np.eye(3), np.array([0.0, 0.0, 10.0]))


def pose(certainty: float, sigma_m: float = 1e-4) -> PoseEstimate:
    """At 10 m; by its covariance it is sure, or hardly known."""
    C = np.diag([1e-3] * 3 + [sigma_m] * 3) ** 2
    R, t_m = FIRST
    return PoseEstimate(R, t_m, C, np.ones(6, np.bool_), 1.0, certainty=certainty)


@given(SHARES, SHARES, SHARES)
def test_far_from_a_start_a_pose_needs_a_fifth_and_more_trust_than_it_leaves_to_the_start(
    certainty: float, trust: float, refused: float
) -> None:
    found = pose(certainty)
    expected = certainty >= 0.2 and found.trust >= refused * (1 - certainty) * trust
    assert is_likely(found, certainty, None, trust, refused) == expected
    assert found.trust == pytest.approx(certainty)


def test_far_from_a_start_a_certain_pose_of_which_little_is_known_is_not_accepted() -> None:
    assert is_likely(pose(0.4), 0.4, None, 0.3, 0.7)
    assert not is_likely(pose(0.4, sigma_m=100.0), 0.4, None, 0.3, 0.7)


def test_what_is_likelier_takes_the_place_of_a_start_that_was_trusted_more() -> None:
    """Either may be right, not both. A start trusted by 0.9 is left 0.38 where the light is unknown and
    a pose far from it is certain by 0.4; where the light is known, a right start would agree."""
    assert is_likely(pose(0.4), 0.4, None, 0.9, 0.7)
    assert not is_likely(pose(0.35), 0.35, None, 0.9, 0.7)
    assert is_likely(pose(0.25), 0.25, None, 0.9, 0.3)
    assert not is_likely(pose(0.15), 0.15, None, 0.1, 0.3)


@given(SHARES, SHARES)
def test_near_a_start_a_pose_needs_half_of_the_trust_of_the_best_start(
    start: float, most: float
) -> None:
    near = pose(start)
    accepted = is_likely(pose(0.0), 0.0, near, most, 0.7)
    assert accepted == (2 * near.trust >= most)


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
