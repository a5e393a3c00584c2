"""Joints by their laws, against SciPy's rotations and searches over all angles."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from posse_core import ComponentError, InputError, Joint, JointCurve, Spacecraft
from posse_core._environment.time import Epoch
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.joints import JointLawChoice
from posse_core._trajectory.joints import (
    BY_LAW,
    BodyMotion,
    CheckedJointLaw,
    GivenJoints,
    JointLaws,
    with_laws,
)
from posse_core.testing import scenes

REGISTRY = load_plugins().registry
EPOCH = Epoch.from_iso("2024-03-01T00:00:00")


def joint(name: str = "wing", kind: Any = "revolute", axis=(0, 1, 0), facing=(1, 0, 0), **more) -> Joint:
    return Joint(
        name,
        kind,
        np.array([0.3, -0.2, 0.1]),
        np.array(axis) / np.linalg.norm(axis),
        facing_body=None if facing is None else np.array(facing) / np.linalg.norm(facing),
        **more,
    )


def craft(*joints: Joint) -> Spacecraft:
    plate = scenes.rectangle("plate", "white")
    return Spacecraft("post", (plate,), {}, joints=joints)


def laws(joints, choices: dict[str, Any], seed: int = 3, where: str = "joints") -> JointLaws:
    made = {name: JointLawChoice.model_validate(choice) for name, choice in choices.items()}
    whole = with_laws(craft(*joints), made, where)
    return JointLaws.of(whole, made, REGISTRY, epoch=EPOCH, seed=seed, where=where)


def motion(t_s, R=None, omega=(0.0, 0.0, 0.0), sun=(0.0, 0.0, 1.0), indices=None) -> BodyMotion:
    t_s = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    count = len(t_s)
    return BodyMotion(
        t_s,
        np.arange(count) if indices is None else np.asarray(indices),
        np.tile(np.eye(3), (count, 1, 1)) if R is None else np.asarray(R),
        np.tile(np.asarray(omega, dtype=np.float64), (count, 1)),
        np.tile(np.asarray(sun) / np.linalg.norm(sun), (count, 1)),
    )


def values(joints, choices, moving: BodyMotion, **more) -> np.ndarray:
    return laws(joints, choices, **more).values_and_rates(moving)[0]


directions = (
    st.lists(st.floats(-1, 1), min_size=3, max_size=3)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: np.array(v) / np.linalg.norm(v))
)


@given(directions, directions, directions, st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_a_tracking_wing_is_as_near_to_the_sun_as_its_axis_allows(axis, facing, sun, turn) -> None:
    """No other angle brings it nearer, in any attitude of the body; SciPy turns the normal."""
    R = Rotation.from_rotvec(turn).as_matrix()
    moving = motion(0.0, R=R[None], sun=sun)
    (value,) = values([joint(axis=axis, facing=facing)], {"wing": "sun-tracking"}, moving)[0]

    def cosine(angle):
        return float(R @ Rotation.from_rotvec(angle * axis).apply(facing) @ sun)

    grid = np.linspace(-np.pi, np.pi, 73)
    best = minimize_scalar(
        lambda x: -cosine(x),
        bounds=(max(grid, key=cosine) - 0.1, max(grid, key=cosine) + 0.1),
        method="bounded",
    )
    assert cosine(value) >= -best.fun - 1e-12
    assert -np.pi <= value <= np.pi


@given(directions, st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_where_the_axis_allows_the_normal_points_at_the_sun(sun, turn) -> None:
    """The axis is across Sun and normal. By the angle of a sine, which is exact for small ones."""
    R = Rotation.from_rotvec(turn).as_matrix()
    sun_body = R.T @ sun
    axis = np.cross(sun_body, [0.3, 0.5, 0.8124])
    axis = axis / np.linalg.norm(axis)
    facing = np.cross(axis, [0.7, -0.1, 0.7])
    facing = facing / np.linalg.norm(facing)
    (value,) = values(
        [joint(axis=axis, facing=facing)], {"wing": "sun-tracking"}, motion(0.0, R[None], sun=sun)
    )[0]
    normal_eci = R @ Rotation.from_rotvec(value * axis).apply(facing)
    assert np.linalg.norm(np.cross(normal_eci, sun)) < 1e-12
    assert normal_eci @ sun > 0


@given(st.floats(-np.pi, np.pi), st.floats(-4, 4), st.floats(0.1, 9))
def test_a_tracking_wing_stops_at_the_nearer_limit(angle: float, low: float, width: float) -> None:
    """Of a fine grid between the limits, none is nearer to the Sun."""
    sun = [np.cos(angle), 0, -np.sin(angle)]  # turned from +x about +y
    limits = (low, low + width)
    (value,) = values([joint(limits=limits)], {"wing": "sun-tracking"}, motion(0.0, sun=sun))[0]
    assert limits[0] <= value <= limits[1]
    assert np.cos(value - angle) >= np.cos(np.linspace(*limits, 400) - angle).max() - 1e-12


@pytest.mark.parametrize("limits", [(0.2, np.inf), (-np.inf, -0.2)])
def test_a_wing_with_one_limit_reaches_all_angles(limits) -> None:
    for angle in np.linspace(-3.1, 3.1, 9):
        sun = [np.cos(angle), 0, -np.sin(angle)]
        (value,) = values([joint(limits=limits)], {"wing": "sun-tracking"}, motion(0.0, sun=sun))[0]
        assert limits[0] <= value <= limits[1]
        assert np.cos(value - angle) == pytest.approx(1, abs=1e-12)


def test_a_sun_along_the_axis_leaves_the_wing_where_it_is() -> None:
    """Rounding must not spin it: the rate is zero too."""
    made = laws([joint()], {"wing": "sun-tracking"})
    for sun in ([0, 1, 0], [1e-12, -1, 2e-12]):
        (value,), (rate,) = made.values_and_rates(motion(5.0, sun=sun))
        assert (value, rate) == (0, 0)
    away = joint(limits=(0.4, 1.0))
    assert values([away], {"wing": "sun-tracking"}, motion(5.0, sun=[0, 1, 0])) == pytest.approx(0.4)


@given(st.floats(-2, 2), st.floats(-3, 3), st.floats(0, 6e3))
def test_the_wing_of_a_spinning_body_turns_against_the_spin(rate, phase, t_s) -> None:
    """Across its own axis, also where the angle begins again after a whole turn."""
    R = Rotation.from_rotvec([0, phase, 0]).as_matrix()
    moving = motion(t_s, R[None], omega=[0, rate, 0], sun=[1, 0, 0])
    (value,), (own,) = laws([joint()], {"wing": "sun-tracking"}).values_and_rates(moving)
    np.testing.assert_allclose(np.cos(value + phase), 1, atol=1e-12)
    assert own == pytest.approx(-rate, abs=1e-9)


def test_a_joint_sees_the_sun_from_the_link_that_carries_it() -> None:
    """A wing on a turntable: two joints of which each may turn as far as it likes, so that the normal
    gets to the Sun wherever it is."""
    table = joint("table", axis=(0, 0, 1), facing=None)
    wing = joint("wing", axis=(0, 1, 0), facing=(1, 0, 0), parent="table")
    slide = joint("slide", "prismatic", axis=(1, 1, 0), facing=None, parent="wing")
    sun = np.array([0.36, 0.48, 0.8])
    made = laws(
        [table, wing, slide],
        {
            "table": {"law": "fixed", "value_deg": np.degrees(np.arctan2(0.48, 0.36))},
            "wing": "sun-tracking",
            "slide": {"law": "rate", "rate_m_s": 0.02, "start_m": 0.1},
        },
    )
    here = made.articulation(motion(7.0, sun=sun))
    np.testing.assert_allclose(here.poses()[0][2] @ [1, 0, 0], sun, atol=1e-12)
    np.testing.assert_allclose(here.values[2], 0.24, atol=1e-12)
    np.testing.assert_allclose(here.rates, [0, 0, 0.02], atol=1e-12)
    # The same normal of a joint that the caller turns instead, whatever the order of the two.
    given_table = GivenJoints({"table": -2.0}, {"table": 0.3})
    there = made.articulation(motion(7.0, sun=sun), given_table)
    normal = there.poses()[0][2] @ [1, 0, 0]
    across = there.poses()[0][2] @ [0, 1, 0]
    np.testing.assert_allclose(np.cross(np.cross(normal, across), normal) @ sun, across @ sun)
    assert normal @ sun == pytest.approx(np.sqrt(1 - (across @ sun) ** 2))
    assert (there.values[0], there.rates[0]) == (-2.0, 0.3)
    later = made.articulation(motion(7.0, sun=sun), GivenJoints({"table": -2.0 + 0.3e-4}))
    assert there.rates[1] == pytest.approx((later.values[1] - there.values[1]) / 1e-4, rel=1e-3)


def test_laws_by_time(tmp_path: Path) -> None:
    moving = motion([-1.0, 0.0, 2.5, 4.0, 10.0])
    np.testing.assert_array_equal(
        values([joint()], {"wing": {"law": "fixed", "value_deg": 30}}, moving)[:, 0], np.radians(30)
    )
    np.testing.assert_array_equal(values([joint()], {"wing": "fixed"}, moving), 0)
    turning = {"wing": {"law": "rate", "rate_deg_s": 6, "start_deg": -90}}
    now, rates = laws([joint()], turning).values_and_rates(moving)
    np.testing.assert_allclose(np.degrees(now[:, 0]), [-96, -90, -75, -66, -30])
    np.testing.assert_allclose(rates, np.radians(6), rtol=1e-9)
    path = tmp_path / "opening.csv"
    path.write_text("t_s,value_deg\n0,0\n4,90\n8,90\n", encoding="utf-8")
    linear = {"wing": {"law": "table", "path": path, "interpolation": "linear"}}
    np.testing.assert_allclose(
        np.degrees(values([joint()], linear, moving)[:, 0]), [0, 0, 56.25, 90, 90]
    )
    smooth = values([joint()], {"wing": {"law": "table", "path": path}}, moving)[:, 0]
    np.testing.assert_allclose(np.degrees(smooth[2]), PchipInterpolator([0, 4, 8], [0, 90, 90])(2.5))
    np.testing.assert_allclose(np.degrees(smooth[[0, 1, 3, 4]]), [0, 0, 90, 90], atol=1e-12)
    assert smooth.max() <= np.radians(90)


def test_a_table_with_an_epoch_has_its_own_times(tmp_path: Path) -> None:
    path = tmp_path / "sliding.csv"
    rows = ["epoch_utc,t_s,value_m", *(f"2024-03-01T00:01:00,{t},{t / 100}" for t in (0, 10))]
    path.write_text("\n".join(rows), encoding="utf-8")
    boom = [joint("boom", "prismatic", facing=None)]
    found = values(boom, {"boom": {"law": "table", "path": path}}, motion([60.0, 64.0, 75.0]))
    np.testing.assert_allclose(found[:, 0], [0, 0.04, 0.1], atol=1e-12)


def test_random_values_are_even_and_follow_index_seed_and_body() -> None:
    many = motion(np.zeros(4000))
    wing = [joint(limits=(-0.5, 2.0))]
    drawn = values(wing, {"wing": "random"}, many)[:, 0]
    low, high = drawn.min(), drawn.max()
    assert -0.5 <= low < -0.49
    assert 1.99 < high <= 2.0
    assert drawn.mean() == pytest.approx(0.75, abs=5 * 2.5 / np.sqrt(12 * 4000))
    np.testing.assert_array_equal(
        values(wing, {"wing": "random"}, motion([9.0], indices=[17]))[:, 0], drawn[17]
    )
    for other in ({"seed": 4}, {"where": "bodies.companion.joints"}):
        assert not np.isin(values(wing, {"wing": "random"}, many, **other), drawn).any()
    two = values([joint(), joint("other")], {"wing": "random", "other": "random"}, many)
    assert abs(np.corrcoef(two.T)[0, 1]) < 5 / np.sqrt(4000)
    assert -np.pi <= two.min() < -3
    once = values(
        wing, {"wing": {"law": "random", "range_deg": [10, 20], "every": "run"}}, motion(np.zeros(9))
    )
    assert len(np.unique(once)) == 1
    assert 10 <= np.degrees(once[0, 0]) <= 20
    (rates,) = np.unique(laws(wing, {"wing": "random"}).values_and_rates(many)[1])
    assert rates == 0


def test_a_row_does_not_depend_on_the_others() -> None:
    table, wing = joint("table", axis=(0, 0, 1), facing=None), joint(parent="table")
    made = laws([table, wing], {"table": {"law": "rate", "rate_deg_s": 3}, "wing": "sun-tracking"})
    whole = motion(np.arange(6.0), sun=[0.2, 0.3, 0.9], omega=[0.01, 0.02, -0.03])
    every, rates = made.values_and_rates(whole)
    row = motion([4.0], sun=[0.2, 0.3, 0.9], omega=[0.01, 0.02, -0.03], indices=[4])
    np.testing.assert_array_equal(made.articulation(row, BY_LAW).values, every[4])
    np.testing.assert_array_equal(made.articulation(row, BY_LAW).rates, rates[4])


@pytest.mark.parametrize(
    ("joints", "choices", "words"),
    [
        ([joint()], {"wnig": "fixed"}, "joints.wnig: post has no such joint; did you mean 'wing'?"),
        ([], {"wing": "fixed"}, "(its joints: none)"),
        ([joint(kind="fixed")], {"wing": "rate"}, "joints.wing: the joint of post is fixed"),
        ([joint()], {"wing": "fxied"}, "joints.wing: no joint-law named 'fxied'; did you mean 'fixed'?"),
        ([joint()], {"wing": {"law": "rate"}}, "give exactly one of rate_deg_s, rate_m_s"),
        (
            [joint()],
            {"wing": {"law": "rate", "rate_m_s": 1}},
            "joints.wing: rate_m_s: the joint wing turns; give rate_deg_s instead",
        ),
        (
            [joint(kind="prismatic")],
            {"wing": {"law": "fixed", "value_deg": 1}},
            "value_deg: the joint wing slides; give value_m instead",
        ),
        ([joint(kind="prismatic")], {"wing": "sun-tracking"}, "has no axis to turn about"),
        ([joint(facing=None)], {"wing": "sun-tracking"}, "has no facing_body"),
        ([joint(kind="prismatic")], {"wing": "random"}, "has no limits; give range_m"),
        (
            [joint(limits=(-0.5, 0.5))],
            {"wing": {"law": "rate", "rate_deg_s": 10}},
            "joints.wing: 30 deg at frame 3 is beyond the joint's limits, -28.6479 deg to 28.6479 deg",
        ),
        (
            [joint(kind="prismatic", limits=(0, 1))],
            {"wing": {"law": "fixed", "value_m": 1.25}},
            "joints.wing: 1.25 m at frame 0 is beyond the joint's limits, 0 m to 1 m",
        ),
        ([joint()], {"wing": {"law": "table", "path": "none.csv"}}, "none.csv: cannot be read: there"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_in_one_line(joints, choices, words: str) -> None:
    with pytest.raises(InputError) as told:
        values(joints, choices, motion(np.arange(5.0)))
    assert words in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t_s,value_m\n0,0\n", "has no value_deg.*docs/joints.md has an example"),
        ("time,angle\n0,0\n", "has none of t_s, value_deg, value_m.*docs/joints.md has an example"),
        ("t_s,value_deg\n0,0\n0,1\n", "its times do not increase"),
        ("t_s,value_deg\n0,x\n", "column 'value_deg'"),
    ],
)
def test_a_table_that_cannot_be_used_is_told(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words) as told:
        values([joint()], {"wing": {"law": "table", "path": path}}, motion(0.0))
    assert str(told.value).startswith(f"joints.wing: {path}")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (GivenJoints({"wign": 0.1}), "joints has 'wign'; did you mean 'wing'?, and"),
        (GivenJoints({"wing": float("nan")}), "joints['wing'] is nan; a finite number is needed"),
        (GivenJoints({"wing": "up"}), "joints['wing'] is 'up'"),  # type: ignore[dict-item]
        (GivenJoints({}, {"wing": 0.1}), "joint_rates has 'wing', and joints has not; give both"),
    ],
)
def test_what_a_caller_cannot_give_is_told(given: GivenJoints, words: str) -> None:
    with pytest.raises(InputError) as told:
        laws([joint()], {"wing": "fixed"}).check_given(given)
    assert words in str(told.value)


def test_a_callers_value_beyond_the_limits_is_told() -> None:
    made = laws([joint(limits=(-1, 1))], {"wing": "fixed"})
    with pytest.raises(InputError, match=r"57\.3 deg at frame 0 is beyond the joint's limits"):
        made.articulation(motion(0.0), GivenJoints({"wing": np.radians(57.3)}))


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        (None, "the array of values is NoneType"),
        (np.zeros(2), "shape (2,), and must be float64 of shape (6,)"),
        (np.zeros(6, np.float32), "is float32"),
        (np.full(6, np.nan), "has numbers that are not finite"),
        (ValueError("no luck"), "failed: ValueError: no luck"),
    ],
)
def test_a_laws_fault_is_named(returned, words: str) -> None:
    """Of two frames it is asked for values at three moments each."""
    law = REGISTRY.create("joint-law", "fixed")

    def broken(around):
        if isinstance(returned, Exception):
            raise returned
        return returned

    law.values = broken
    checked = JointLaws(
        craft(joint()),
        {"wing": "wing"},
        {"wing": CheckedJointLaw(law, "loose", "joints.wing")},
        EPOCH,
        0,
        "joints",
    )
    with pytest.raises(ComponentError) as told:
        checked.values_and_rates(motion([0.0, 1.0]))
    assert str(told.value).startswith("joint-law 'loose'")
    assert words in str(told.value)


# Animations


def animated(**more: Any) -> Joint:
    """A joint whose file has a jump after 2 s and a way of 6 s after that, in an animation of 20 s."""
    curves = {
        "jump": JointCurve.steps(np.array([0.0, 2.0, 5.0]), np.array([0.1, 0.5, -0.3]), 20.0),
        "way": JointCurve.lines(np.array([2.0, 8.0]), np.array([0.0, 1.2]), 20.0),
    }
    return joint(**{"animations": curves, **more})


def test_an_animation_is_played_once_from_its_start() -> None:
    t_s = np.array([-5.0, 10.0, 12.5, 15.0, 18.0, 500.0])
    law = {"law": "animation", "animation": "way", "start_s": 10.0}
    made, rates = laws([animated()], {"wing": law}).values_and_rates(motion(t_s))
    np.testing.assert_allclose(made[:, 0], [0, 0, 0.1, 0.6, 1.2, 1.2], atol=1e-12)
    np.testing.assert_allclose(rates[:, 0], [0, 0, 0.2, 0.2, 0, 0], atol=1e-12)


def test_an_animation_repeats_with_the_period_of_all_its_joints() -> None:
    t_s = np.array([-15.0, 5.0, 25.0, 45.0, 59.0])
    made = values(
        [animated()], {"wing": {"law": "animation", "animation": "way", "repeat": True}}, motion(t_s)
    )
    np.testing.assert_allclose(made[:, 0], [0.6, 0.6, 0.6, 0.6, 1.2], atol=1e-12)


def test_a_joint_rests_on_both_sides_of_a_jump_and_at_it() -> None:
    """The first animation is the default; the difference across it would be 200 rad/s."""
    t_s = np.array([1.9995, 2.0, 2.0005, 5.0])
    made, rates = laws([animated()], {"wing": "animation"}).values_and_rates(motion(t_s))
    np.testing.assert_array_equal(made[:, 0], [0.1, 0.5, 0.5, -0.3])
    np.testing.assert_array_equal(rates[:, 0], 0)


@pytest.mark.parametrize(
    ("moved", "choice", "words"),
    [
        (joint(), "animation", "joints.wing: animation: the joint wing has no animation; take the law"),
        (animated(), {"law": "animation", "animation": "wa"}, "no animation 'wa'; did you mean 'way'?"),
        (animated(), {"law": "animation", "animation": "x"}, "no animation 'x'; it has jump, way"),
    ],
)
def test_animations_that_are_not_there_are_told(moved: Joint, choice: Any, words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        values([moved], {"wing": choice}, motion([0.0]))
