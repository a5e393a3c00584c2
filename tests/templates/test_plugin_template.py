"""The template of plugins: each kind of component is generated, put on the path as pip would lay it,
loaded by its entry point, and passes its own tests, which are the conformance kit's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from copier import run_copy
from copier.errors import CopierError

from posse_core._plugins.kinds import KINDS

ROOT = Path(__file__).parents[2]
TEMPLATE = ROOT / "templates" / "plugin"
STYLE = ("E", "F", "W", "I", "B", "UP", "SIM", "RUF", "NPY", "PT", "C4", "PIE")
METADATA = """
import os, sys
from setuptools import build_meta
for folder in sys.argv[1:]:
    os.chdir(folder)
    build_meta.prepare_metadata_for_build_wheel(folder)
"""
"""Puts each distribution's metadata beside its source, as an editable installation does elsewhere."""
LOAD = """
import json
from posse_core._plugins.loading import load_plugins
plugins = load_plugins()
registry = plugins.registry
for kind, name in json.loads(input()).items():
    registry.load(kind, name) if kind == "subcommand" else registry.create(kind, name)
print(json.dumps({status.name: status.state for status in plugins.statuses}))
"""


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The folder of a plugin of each kind, with its metadata."""
    folder = tmp_path_factory.mktemp("generated")
    folders = {kind: folder / kind for kind in KINDS}
    for kind, target in folders.items():
        answers = {"kind": kind, "name": f"my-{kind}"}
        run_copy(str(TEMPLATE), target, data=answers, defaults=True, quiet=True)
    subprocess.run([sys.executable, "-c", METADATA, *map(str, folders.values())], check=True, stdout=-3)
    return folders


def environment(folders: dict[str, Path]) -> dict[str, str]:
    """Variables of a process that finds the plugins."""
    paths = [str(path) for folder in folders.values() for path in (folder, folder / "src")]
    paths.append(os.environ.get("PYTHONPATH", ""))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([*paths, str(ROOT)])}


def test_there_is_one_for_every_kind() -> None:
    assert {path.name for path in (TEMPLATE / "kinds").iterdir()} == set(KINDS)


def test_the_hook_is_that_of_the_kind(generated: dict[str, Path]) -> None:
    for name, kind in KINDS.items():
        (module,) = generated[name].glob("src/*/__init__.py")
        assert f"def {kind.hook}()" in module.read_text()


def test_the_conformance_kit_is_that_of_the_kind(generated: dict[str, Path]) -> None:
    for name, kind in KINDS.items():
        (tests,) = generated[name].glob("tests/*.py")
        assert f"({kind.conformance.partition(':')[2]}):" in tests.read_text(), name


def test_entry_points_are_found_and_components_are_made(generated: dict[str, Path]) -> None:
    named = json.dumps({kind: f"my-{kind}" for kind in KINDS})
    done = subprocess.run(
        [sys.executable, "-c", LOAD],
        input=named,
        capture_output=True,
        text=True,
        env=environment(generated),
    )
    assert done.returncode == 0, done.stderr
    states = json.loads(done.stdout)
    mine = {name: states.get(name) for name in (f"posse_my_{kind.replace('-', '_')}" for kind in KINDS)}
    assert set(mine.values()) == {"ok"}, mine


@pytest.mark.slow
def test_every_plugin_passes_its_tests(generated: dict[str, Path], tmp_path: Path) -> None:
    """In one process, which imports the core once."""
    report = tmp_path / "report.xml"
    options = ("-q", "-W", "error", "-p", "no:cacheprovider", "--import-mode=importlib", "--tb=short")
    places = [str(folder / "tests") for folder in generated.values()]
    command = [
        sys.executable,
        "-m",
        "pytest",
        *options,
        f"--junitxml={report}",
        "--rootdir",
        str(tmp_path),
    ]
    done = subprocess.run(
        [*command, "-c", os.devnull, *places],
        capture_output=True,
        text=True,
        env=environment(generated),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout[-6000:]
    cases = ElementTree.parse(report).iter("testcase")
    tested = {
        str(case.get("classname")).split(".")[-2 if "Test" in str(case.get("classname")) else -1]
        for case in cases
    }
    assert tested == {f"test_posse_my_{kind.replace('-', '_')}" for kind in KINDS}


def test_the_style_is_the_projects(generated: dict[str, Path]) -> None:
    ruff = [sys.executable, "-m", "ruff"]
    width = ["--isolated", "--no-cache", "--line-length", "105"]
    for folder in generated.values():
        for rule in (
            ["check", "--select", ",".join(STYLE), "--ignore", "RUF001,RUF002,RUF003"],
            ["format", "--check"],
        ):
            done = subprocess.run(
                [*ruff, *rule, *width, "."], cwd=folder, capture_output=True, text=True
            )
            assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({"kind": "sensor", "name": "My Radar"}, "lower-case letters, digits and single hyphens"),
        ({"kind": "sensor", "name": "radar", "package": "9-radar"}, "digits and underscores"),
        ({"kind": "radar"}, "radar"),
    ],
)
def test_wrong_answers_are_refused(tmp_path: Path, answers: dict[str, str], said: str) -> None:
    with pytest.raises((CopierError, ValueError), match=said):
        run_copy(str(TEMPLATE), tmp_path / "p", data=answers, defaults=True, quiet=True)
    assert not (tmp_path / "p").exists()
