"""Joints that a scene source must not build are refused in one line that names joint and fault."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posse_core import ComponentError, Joint, Material, Spacecraft
from posse_core._simulator.returned import checked_spacecraft
from posse_core.testing import scenes

TABLE = Joint("table", "revolute", np.zeros(3), np.array([0.0, 0.0, 1.0]))
WING = replace(TABLE, name="wing", parent="table", facing_body=np.array([1.0, 0.0, 0.0]))
PLATE = replace(scenes.rectangle("plate", "white"), joint="wing")
SOUND = Spacecraft(
    "post",
    (PLATE,),
    {"white": Material("white")},
    {"S1": np.zeros(3)},
    joints=(TABLE, WING),
    keypoint_joints={"S1": "wing"},
)


def test_a_sound_spacecraft_passes() -> None:
    assert checked_spacecraft(SOUND, "post") is SOUND


def wing(**changed: Any) -> dict[str, Any]:
    return {"joints": (TABLE, replace(WING, **changed))}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"joints": (TABLE, "wing")}, "a joint is str, and must be Joint"),
        (wing(name="a/b"), "the joint 'a/b' needs a name of letters"),
        (wing(name="table"), "the joint 'table': two joints have this name"),
        ({"joints": (WING, TABLE)}, "'wing': no joint 'table', its parent, comes before it"),
        (wing(parent="wing"), "'wing': no joint 'wing', its parent, comes before it"),
        (wing(kind="ball"), "its kind 'ball' is none of ('revolute', 'prismatic', 'fixed')"),
        (wing(origin_body_m=np.zeros(2)), "origin_body_m is float64 of shape (2,)"),
        (wing(axis_body=np.array([0.0, 0.0, np.nan])), "axis_body has numbers that are not finite"),
        (wing(axis_body=np.array([0.0, 0.0, 2.0])), "axis_body is [0. 0. 2.], not of length one"),
        (wing(facing_body=np.zeros(3)), "facing_body is [0. 0. 0.], not of length one"),
        (wing(animations={"open": [0.0, 1.0]}), "the animation 'open' is list, and must be JointCurve"),
        (wing(limits=(1.0, 0.0)), "its limits (1.0, 0.0) are not in order"),
        (wing(limits=(np.nan, 0.0)), "are not in order"),
        ({"joints": (TABLE,)}, "the part 'plate' is on the joint 'wing', not there"),
        ({"keypoint_joints": {"S1": "arm"}}, "the keypoint 'S1' is on the joint 'arm', not there"),
        ({"keypoint_joints": {"S9": "wing"}}, "keypoint_joints has S9, which are no keypoints"),
    ],
)
def test_what_is_no_joint_is_told(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(ComponentError) as told:
        checked_spacecraft(replace(SOUND, **changed), "post")
    assert str(told.value).startswith("scene 'post': ")
    assert words in str(told.value)
