"""The laws' keys in a scenario, and what the user is told of a wrong one."""

from __future__ import annotations

from typing import Any

import pytest

from posse_core._errors import InputError
from posse_core._plugins.options import validated
from posse_core._scenario.attitude import AttitudeConfig, NadirLaw, SpinLaw, TrackLaw


def read(raw: dict[str, Any]) -> AttitudeConfig:
    return validated(AttitudeConfig, raw, lambda path: ".".join(map(str, ("attitude", *path))))


def test_nadir_and_track_by_default() -> None:
    assert read({}) == AttitudeConfig(target=NadirLaw(), camera=TrackLaw(offset=0.02))


def test_a_law_is_chosen_by_name() -> None:
    assert read({"target": {"law": "spin", "rate_rpm": 3}}).target == SpinLaw(rate_rpm=3)


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ({"target": {"law": "spni"}}, "'nadir', 'sun-pointing', 'inertial', 'spin'"),
        ({"target": {"law": "spin", "rate": 3}}, "rate: unknown key; did you mean 'rate_rpm'?"),
        ({"target": {"law": "spin", "sun_angle_deg": 180}}, "less than 180"),
        ({"target": {"law": "spin", "rate_rpm": float("nan")}}, "rate_rpm.*finite"),
        ({"target": {"law": "sun-pointing", "body_axis": "up"}}, r"'\+x', '-x'"),
        ({"target": {"law": "inertial", "q_eci_from_body": [0, 0, 0, 0]}}, "zero quaternion"),
        ({"target": {"law": "tumbling", "rate_body_deg_s": [1, 0, 0]}}, "moments_kg_m2.*missing"),
        ({"camera": {"law": "track", "offset": -0.1}}, "camera.*offset.*greater than or equal to 0"),
    ],
)
def test_a_wrong_key_is_told_in_one_line(raw: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read(raw)
    assert "\n" not in str(error.value)
