"""A misspelt name in a scenario ends in one line: the key as the user wrote it, and the nearest name."""

import pytest
from click.testing import CliRunner

from posse_core._cli.main import posse
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario


def message(key: str, value: object) -> str:
    with pytest.raises(InputError) as caught:
        load_scenario("aqua", load_plugins().registry, {key: value})
    return str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "fault", "hint"),
    [
        (
            "relative",
            {"design": {"name": "fly-arond", "range_m": 20}},
            "relative.design.name",
            "fly-around",
        ),
        ("sensors.l", {"type": "lidar", "pattern": {"shape": "spirla"}}, "pattern.shape", "spiral"),
        ("sensor.psf", {"shape": "gausian"}, "sensor.psf.shape", "gaussian"),
        (
            "relative",
            {"design": {"name": "fly-around", "rangem": 2}},
            "relative.design.rangem",
            "range_m",
        ),
    ],
)
def test_the_nearest_name_is_given(key, value, fault, hint):
    said = message(key, value)
    assert f"{fault}: " in said
    assert f"did you mean {hint!r}?" in said
    assert "\n" not in said
    for raw in ("tag", "discriminator", "found using"):
        assert raw not in said


def test_where_no_name_is_near_all_are_listed():
    said = message("relative", {"design": {"name": "zzz"}})
    assert "relative.design.name: there is no 'zzz'; known are fly-around, safe-ellipse, " in said
    assert said.endswith("view-sphere")


def test_a_missing_name_is_asked_for():
    said = message("relative", {"design": {"range_m": 20}})
    assert "relative.design.name: missing; give one of fly-around, safe-ellipse, " in said


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({"name": "fly-around"}, "relative.design.range_m: missing; add it"),
        ({"name": "fly-around", "range_m": -2}, "relative.design.range_m: input should be"),
        (7, "relative.design: input should be a mapping of keys to values (it is 7)"),
    ],
)
def test_the_key_is_the_users_without_the_name_that_selects_it(value, said):
    assert f"option {said}" in message("relative", {"design": value})


def test_the_members_of_a_union_of_types_are_no_keys():
    assert "flight.measurement.delay_s: input should be" in message("flight.measurement.delay_s", "x")


def test_describe_shows_the_names_of_designs():
    shown = CliRunner().invoke(posse, ["describe", "scenario"]).output
    rows = [row.strip() for row in shown.splitlines()]
    for name in (
        "fly-around",
        "safe-ellipse",
        "v-bar-hop",
        "r-bar-approach",
        "hold-point",
        "view-sphere",
    ):
        assert any(row.startswith(f"name: {name}. ") for row in rows)
    assert not any(row.startswith("name: Natural") for row in rows)


def test_describe_lists_the_values_that_a_key_may_have():
    shown = CliRunner().invoke(posse, ["describe", "attitude-law", "ned"]).output
    assert "(earth, sun)" in shown
