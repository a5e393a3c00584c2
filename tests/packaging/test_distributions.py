"""What the distributions say of themselves; ``make dist`` builds and tries them."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
import yaml
from build.util import project_wheel_metadata
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from posse_core import __version__
from posse_core._plugins.kinds import RESERVED

ROOT = Path(__file__).parents[2]
PROJECTS = {
    path.parent.relative_to(ROOT).as_posix(): tomllib.loads(path.read_text("utf-8"))["project"]
    for path in (
        ROOT / "pyproject.toml",
        *ROOT.glob("plugins/*/pyproject.toml"),
        *ROOT.glob("packaging/*/*.toml"),
    )
}
"""Folder of each distribution → the table ``project`` of its pyproject.toml."""
PLUGINS = {project["name"] for folder, project in PROJECTS.items() if folder.startswith("plugins/")}


@pytest.fixture(scope="module")
def requirements(tmp_path_factory: pytest.TempPathFactory) -> list[Requirement]:
    """What the distribution "posse" asks for, by its metadata."""
    folder = tmp_path_factory.mktemp("meta") / "posse"
    shutil.copytree(ROOT / "packaging" / "posse", folder)  # the links' content, as in an sdist
    metadata = project_wheel_metadata(folder, isolated=False)
    assert metadata["Version"] == __version__
    return [Requirement(text) for text in metadata.get_all("Requires-Dist") or []]


def asked(requirements: list[Requirement], extra: str) -> set[str]:
    return {
        requirement.name
        for requirement in requirements
        if requirement.marker and requirement.marker.evaluate({"extra": extra})
    }


def test_all_that_posse_asks_for_is_of_its_own_version(requirements: list[Requirement]) -> None:
    assert {str(requirement.specifier) for requirement in requirements} == {f"=={__version__}"}


def test_posse_alone_is_the_core(requirements: list[Requirement]) -> None:
    assert {r.name for r in requirements if r.marker is None} == {"posse-core"}


def test_all_is_every_official_plugin_and_s3(requirements: list[Requirement]) -> None:
    assert asked(requirements, "all") == {*RESERVED, "posse-core"} == {*PLUGINS, "posse-core"}
    assert {
        tuple(requirement.extras) for requirement in requirements if requirement.name == "posse-core"
    } == {(), ("s3",)}


@pytest.mark.parametrize(
    ("extra", "plugin"),
    [(re.split("-", name)[-1], name) for name in sorted(RESERVED)],
)
def test_an_extra_is_named_like_what_it_adds(
    requirements: list[Requirement], extra: str, plugin: str
) -> None:
    assert asked(requirements, extra) == {plugin}


@pytest.mark.parametrize("folder", PROJECTS)
def test_no_distribution_has_a_version_of_its_own(folder: str) -> None:
    project = PROJECTS[folder]
    assert "version" not in project
    assert "version" in project["dynamic"]
    for text in project.get("dependencies", []):
        requirement = Requirement(text)
        if requirement.name == "posse-core":
            assert requirement.specifier.contains(__version__)


@pytest.mark.parametrize("folder", PROJECTS)
def test_all_run_on_the_same_versions_of_python(folder: str) -> None:
    supported = SpecifierSet(PROJECTS[folder]["requires-python"])
    said = {c.split(" :: ")[-1] for c in PROJECTS[folder]["classifiers"] if "Python :: 3." in c}
    assert said == {f"3.{minor}" for minor in range(30) if supported.contains(f"3.{minor}")}


@pytest.mark.parametrize("folder", PROJECTS)
def test_a_readme_leads_to_no_file_that_an_index_lacks(folder: str) -> None:
    text = (ROOT / folder / PROJECTS[folder]["readme"]).read_text("utf-8")
    assert [link for link in re.findall(r"\]\(([^)]*)\)", text) if not link.startswith("https://")] == []


def test_a_citation_names_the_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == __version__


def test_the_changes_begin_with_the_version() -> None:
    first = re.search(r"^## (\S+?),? ", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert first is not None
    assert first[1] == __version__


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml")), ids=lambda p: p.stem
)
def test_an_issue_form_is_complete(path: Path) -> None:
    form = yaml.safe_load(path.read_text("utf-8"))
    assert set(form) <= {"name", "description", "title", "labels", "assignees", "body"}
    assert form["name"]
    assert form["description"]
    ids = [part["id"] for part in form["body"]]
    assert len(ids) == len(set(ids))
    for part in form["body"]:
        assert part["type"] in {"markdown", "textarea", "input", "dropdown", "checkboxes"}
        assert part["attributes"]["label"]
