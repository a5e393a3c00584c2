"""The table of kinds against what reads it: hooks, public names, documentation, official plugins."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import posse_core
from posse_core._plugins import hooks
from posse_core._plugins.kinds import KINDS, RESERVED, import_target, reserved_for
from posse_core._plugins.loading import load_plugins
from posse_core.testing import PropagatorConformance
from posse_core.testing.conformance import Conformance

DOCS = Path(__file__).parents[2] / "docs" / "plugins.md"
OBSERVERS = {"posse_run_started", "posse_frame_completed", "posse_run_finished"}


def test_every_hook_is_of_a_kind_or_an_observer() -> None:
    declared = {name for name in vars(hooks) if name.startswith("posse_")}
    assert declared == {kind.hook for kind in KINDS.values()} | OBSERVERS


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_what_a_kind_names_exists_and_is_public(kind) -> None:
    asked = [kind.interface, *(c.interface for c in kind.capabilities.values() if c.interface)]
    for target in [*asked, kind.conformance]:
        assert isinstance(import_target(target), type)
        module, _, name = target.partition(":")
        assert module in ("posse_core", "posse_core.testing", "click")
        assert module != "posse_core" or name in posse_core.__all__


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_the_documented_capabilities_are_the_tables(kind) -> None:
    """docs/plugins.md has a table below a kind's heading, a row for each capability."""
    text = DOCS.read_text(encoding="utf-8")
    (section,) = re.findall(rf"\n## [^\n]*\(`{kind.hook}`\)\n(.*?)(?=\n## |\Z)", text, flags=re.S)
    documented = dict(re.findall(r"^\| `([^`]+)` \| (.*?) \|$", section, flags=re.M))
    assert documented == {word: capability.claim for word, capability in kind.capabilities.items()}


def test_the_documented_classes_are_the_tables() -> None:
    """docs/plugins.md has a row for the class of each kind, with the method that it asks for."""
    text = DOCS.read_text(encoding="utf-8")
    rows = re.findall(r"^\| [a-z ]+ \| `(\w+Conformance)` \| `(\w+)\(\w*\)` \|", text, flags=re.M)
    classes = {kind.conformance.partition(":")[2] for kind in KINDS.values()}
    assert {name for name, _ in rows} == classes
    for name, method in rows:
        found = getattr(posse_core.testing, name)
        assert getattr(found, method).__isabstractmethod__


def test_the_reserved_names_are_what_the_official_plugins_bring() -> None:
    for status in load_plugins().statuses:
        if status.dist in RESERVED:
            names = RESERVED[status.dist]
            reserved = {f"{kind}:{name}" for kind in names for name in names[kind] if kind != "plugin"}
            assert set(status.components) == reserved
            assert names["plugin"] == (status.name,)


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_every_kind_has_a_conformance_class_of_its_own(kind) -> None:
    found = import_target(kind.conformance)
    assert issubclass(found, Conformance)
    own = {name for name in dir(found) if name.startswith("test_")} - set(dir(Conformance))
    assert len(own) >= 3
    assert [other.name for other in KINDS.values() if other.conformance == kind.conformance] == [
        kind.name
    ]


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_every_component_of_ours_is_tested_by_the_kit(kind) -> None:
    """A file of tests that uses the conformance class names the component or its class, or goes
    through the names of the registry."""
    root = DOCS.parents[1]
    files = [*root.glob("tests/**/test_*.py"), *root.glob("plugins/*/tests/test_*.py")]
    class_name = kind.conformance.partition(":")[2]
    kits = [text for text in (path.read_text("utf-8") for path in files) if f"({class_name})" in text]
    registry = load_plugins().registry
    for spec in registry.specs(kind.name):
        if not registry.is_core(kind.name, spec.name) and not reserved_for(kind.name, spec.name):
            continue
        words = (f'names("{kind.name}")', f'"{spec.name}"', f"{spec.factory.partition(':')[2]}(")
        assert any(word in text for text in kits for word in words), spec.name


def test_the_kit_refuses_a_capability_that_the_kind_does_not_have() -> None:
    class Misspelt(PropagatorConformance):
        capabilities = frozenset({"own-frame"})

    with pytest.raises(AssertionError, match="did you mean 'own-frames'"):
        Misspelt().test_the_capabilities_are_known()
    PropagatorConformance().test_the_capabilities_are_known()
