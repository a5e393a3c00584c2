"""The laws' keys in a scenario, and what the user is told of a wrong one."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.attitude import AttitudeConfig, LawChoice
from posse_core._scenario.load import dump_scenario, load_scenario
from posse_core._scenario.model import Scenario
from posse_core._trajectory.attitude import Laws

REGISTRY = load_plugins().registry


def read(attitude: dict[str, Any], **overrides: Any) -> Scenario:
    return load_scenario(
        {
            "target": "aqua",
            "orbit": {
                "state_eci": {"epoch_utc": "2022-01-31", "r_m": [7e6, 0, 0], "v_m_s": [0, 7e3, 0]}
            },
            "renderer": "raster",
            "attitude": attitude,
        },
        REGISTRY,
        overrides,
    )


def dumped(scenario: Scenario) -> Any:
    return yaml.safe_load(dump_scenario(scenario))["attitude"]


def test_nadir_and_track_by_default() -> None:
    assert dumped(read({})) == {"target": {"law": "nadir"}, "camera": {"law": "track", "offset": 0.0}}


@pytest.mark.parametrize("spin", ["spin", {"law": "spin"}, {"law": "spin", "rate_rpm": 15}])
def test_a_law_is_chosen_by_name(spin: Any) -> None:
    assert list(dumped(read({"target": spin}))["target"].items()) == [
        ("law", "spin"),
        ("body_axis", "+z"),
        ("rate_rpm", 15.0),
        ("phase_deg", 0.0),
        ("sun_angle_deg", 90.0),
    ]


def test_naming_another_law_leaves_the_formers_options() -> None:
    spin = {"target": {"law": "spin", "rate_rpm": 3}}
    other = read(spin, **{"attitude.target.body_axis": "+x", "attitude.target.law": "tracking"})
    assert dumped(other)["target"] == {"law": "tracking", "body_axis": "+x"}
    same = read(spin, **{"attitude.target.law": "spin", "attitude.target.phase_deg": 5})
    assert dumped(same)["target"]["rate_rpm"] == 3
    assert dumped(read({"target": "spin"}, **{"attitude.target.rate_rpm": 4}))["target"]["rate_rpm"] == 4


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ({"target": {"law": "spni"}}, "target.law: no attitude-law named 'spni'; did you mean 'spin'"),
        ({"target": {"body_axis": "+x"}}, "target.law: missing; add it"),
        ({"target": {"law": "spin", "rate": 3}}, "rate: unknown key; did you mean 'rate_rpm'?"),
        ({"target": {"law": "nadir", "rate": 3}}, "rate: unknown key; no keys are known here"),
        ({"target": {"law": "spin", "options": {}, "x": 1}}, "x: unknown key; known keys are law, opt"),
        ({"target": {"law": "spin", "sun_angle_deg": 180}}, "less than 180"),
        ({"target": {"law": "spin", "rate_rpm": float("nan")}}, "rate_rpm.*finite"),
        ({"target": {"law": "sun-pointing", "body_axis": "up"}}, r"'\+x', '-x'"),
        ({"target": {"law": "inertial", "q_eci_from_body": [0, 0, 0, 0]}}, "zero quaternion"),
        ({"target": {"law": "tumbling", "rate_body_deg_s": [1, 0, 0]}}, "moments_kg_m2.*missing"),
        ({"camera": {"law": "track", "offset": -0.1}}, "camera.*offset.*greater than or equal to 0"),
        (
            {"camera": {"law": "tracking", "body_axis": "+x"}},
            "law: 'tracking' is not made for the camera; laws that are: file, pointing-error,"
            " random-pointing, track",
        ),
        ({"camera": {"law": "random-pointing", "off_axis_deg": [9, 3]}}, "least and the largest angle"),
        (
            {"target": "track"},
            "target.law: 'track' is not made for the target; laws that are: file, iner",
        ),
    ],
)
def test_a_wrong_key_is_told_in_one_line(raw: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read(raw)
    assert str(error.value).startswith("scenario: attitude.")
    assert "\n" not in str(error.value)


def test_a_law_is_not_made_for_what_it_cannot_orient() -> None:
    config = AttitudeConfig(camera=LawChoice(law="nadir"))
    with pytest.raises(InputError, match=r"^attitude\.camera\.law: 'nadir' is not made for the camera"):
        Laws.of(config, REGISTRY)
