"""YAML that would hang, exhaust memory or confuse a parser is refused in one line."""

import pytest
import yaml

from posse_core import InputError
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._scenario.yaml_lines import YamlText

GROWING = "a0: &a0 [x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)
)
MERGED = "a0: &a0 {k: 1}\n" + "".join(
    f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 12)
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (GROWING, "more than 1000000 values"),
        (MERGED, "more than 1000000 values"),
        ("a: &a [*a]", "line 1: .*contains itself"),
        ("a: &a {b: *a}", "contains itself"),
        ("[" * 10_000, "nested deeper"),
        ("a:\n  ? [a, b]\n  : 1", "line 2: a key must be a word"),
        ("a: 1\nb: !!bool maybe", "line 2: the tag .*bool"),
        ("a: !!int abc", "the tag .*int"),
        ("a: !!timestamp 5", "the tag"),
        ("a: !!set {b}", "the tag"),
        ("a: !!python/object:os.system x", "the tag"),
        ('a: "x\\0y"', "NUL"),
        ("a: " + "9" * 5000, "not valid YAML"),
    ],
)
def test_refused_in_one_line(text, words):
    with pytest.raises(InputError, match=words) as told:
        YamlText(text, "s.yaml")
    assert str(told.value).startswith("s.yaml")
    assert "\n" not in str(told.value)


def test_what_is_harmless_is_read_as_before():
    text = "a: &x [1, 2.5, .inf, no, ~]\nb: *x\nc: {<<: {d: 1}, e: !!str 5}\n0: 1e-5\n"
    value = YamlText(text, "s.yaml").value
    assert value["a"] == [1, 2.5, float("inf"), "no", None]
    assert value["b"] == value["a"]
    assert value["c"] == {"d": 1, "e": "5"}
    assert value[0] == 1e-5


@pytest.mark.parametrize("value", [1e300, -1e-300, 10**400])
def test_numbers_beyond_all_quantities(value):
    with pytest.raises(InputError, match=r"option constants\.au_m: .* is beyond 1e-40 to 1e\+40"):
        load_scenario("aqua", load_plugins().registry, {"constants.au_m": value})


def test_a_long_list_is_no_attack():
    times = list(range(20_000))
    assert YamlText(yaml.safe_dump({"t_s": times}, default_flow_style=True), "s").value["t_s"] == times
