"""How likely poses are by keypoints and by detail, as docs/refining.md says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._interfaces.detector import PoseEstimate
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import prior
from posse_core._refinement.trail import MATERIALS_KNOWN, Trail, weighed

HERE = np.array([0.0, 0.0, 10.0])
CERTAINTIES = st.floats(0.0, 1.0)


def start(turn_deg: float, certainty: float) -> PoseEstimate:
    """At 10 m, turned about the line of sight, known to 0.1° and 1 mm."""
    C = np.diag([np.radians(0.1)] * 3 + [1e-3] * 3) ** 2
    R = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    return PoseEstimate(R, HERE, C, np.ones(6, np.bool_), 1.0, certainty=certainty)


@given(CERTAINTIES, CERTAINTIES)
def test_another_side_is_as_likely_as_the_surest_start_leaves_it(one: float, other: float) -> None:
    """At the place of both starts, 90° from each."""
    starts = [start(0, one), start(180, other)]
    there = Placement(start(90, 1).R_cam_from_body, HERE)
    surest = max(each.trust for each in starts)
    assert prior(there, starts, ()) == pytest.approx(0.33 * (1 - 0.9 * surest), abs=1e-3)


@given(CERTAINTIES)
def test_at_a_start_a_pose_is_as_likely_as_its_trust_says(certainty: float) -> None:
    first = start(0, certainty)
    trust = first.trust
    at = prior(Placement(first.R_cam_from_body, HERE), [first], ())
    assert at == pytest.approx((trust + 0.01) ** 0.5 + 0.33 * (1 - 0.9 * trust))


@pytest.mark.parametrize(
    ("lead", "shares"), [(0.0, (1, 1)), (0.5, (1, np.exp(-0.75))), (-2.0, (np.exp(-3), 1))]
)
def test_each_standard_deviation_of_detail_multiplies_the_odds(lead: float, shares: Any) -> None:
    """Of the pose that leaves less, whichever it is."""
    comparer: Any = SimpleNamespace(lead=lambda placement, other, others: lead)
    found: Any = SimpleNamespace(placement=Placement(np.eye(3), HERE))
    trails = [
        Trail(found, comparer, np.array([0.0, 0.0, -1.0]), 0.7, False, 0, 1.0, 1.0, MATERIALS_KNOWN)
        for _ in range(2)
    ]
    assert [each.share for each in weighed(trails, 1.5)] == pytest.approx(list(shares))
