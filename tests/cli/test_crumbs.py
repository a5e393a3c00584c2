"""What commands say to someone who types what comes to mind."""

import math

import pytest
from command import run_posse
from hypothesis import given
from hypothesis import strategies as st

from posse_core import __version__
from posse_core._evaluation.crosscheck.tables import PAIR_COLUMNS, RENDERER_COLUMNS
from posse_core._evaluation.numbers import LEAST, number


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "--workers", 0), "'--workers': 0 is not in the range x>=1"),
        (("run", "--frame-time-limit", 0), "'--frame-time-limit': 0"),
        (
            ("run", "--workers", 5000),
            "--executor local.workers: input should be less than or equal to 1024",
        ),
        (("detect", "nowhere.png"), "nowhere.png: there is no such file or folder"),
    ],
)
def test_a_message_has_the_option_as_it_was_typed(arguments, said):
    code, _, error = run_posse(*arguments)
    assert code == 2
    assert said in error
    assert "--." not in error


def test_images_are_found_in_a_dataset_by_whoever_names_its_folder(tmp_path):
    (tmp_path / "images").mkdir()
    code, _, error = run_posse("detect", tmp_path)
    assert code == 2
    assert error.rstrip().endswith(f"; give {tmp_path / 'images'}")


def test_axes_of_an_import_are_named_as_they_are_typed(tmp_path):
    (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    code, _, error = run_posse("import", tmp_path / "one.obj", "--scale", 1, "--axes", "x x z")
    assert code == 2
    assert error.startswith("posse: --axes: ")


def test_the_version_is_told_as_a_command_too():
    code, said, _ = run_posse("version")
    assert code == 0
    assert said.splitlines()[0].startswith(f"posse {__version__}, Python 3.")
    _, plugins, _ = run_posse("plugins")
    for row in said.splitlines()[1:]:
        distribution, version = row.split(", ")[0].split()
        assert any(distribution in line and version in line for line in plugins.splitlines())


def test_the_columns_of_a_crosscheck_are_explained():
    _, said, _ = run_posse("crosscheck", "--help")
    text = " ".join(said.partition("Columns: ")[2].split())
    columns = [*RENDERER_COLUMNS, *PAIR_COLUMNS]
    named = {column.heading.split(", ")[0] for column in columns} - {"frames"}
    assert named
    assert [name for name in named if name not in text] == []


@pytest.mark.parametrize("command", ["fly", "track"])
def test_the_figures_of_flights_are_explained(command):
    _, said, _ = run_posse(command, "--help")
    for word in ("Error of the estimate:", "single-frame poses:", "NEES:", "Time lost:"):
        assert word in " ".join(said.split())


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e15, max_value=1e15))
def test_a_number_is_shown_to_its_digits_without_an_exponent_that_is_positive(value):
    said = number(value, 3)
    assert "e+" not in said
    if 0 < abs(value) < LEAST:
        assert said == "< 1e-9"
    else:
        assert float(said) == pytest.approx(value, rel=0.5e-2)


def test_counts_have_all_their_digits():
    assert number(123457, 3) == "123457"


@pytest.mark.parametrize("value", [None, math.nan, math.inf])
def test_where_there_is_no_number_there_is_a_dash(value):
    assert number(value) == "–"
