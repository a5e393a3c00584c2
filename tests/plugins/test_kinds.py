"""The table of kinds against what reads it: hooks, public names, documentation, official plugins."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import posse_core
from posse_core._plugins import hooks
from posse_core._plugins.kinds import KINDS, RESERVED, import_target
from posse_core._plugins.loading import load_plugins
from posse_core.testing import PropagatorConformance

DOCS = Path(__file__).parents[2] / "docs" / "plugins.md"
OBSERVERS = {"posse_run_started", "posse_frame_completed", "posse_run_finished"}


def test_every_hook_is_of_a_kind_or_an_observer() -> None:
    declared = {name for name in vars(hooks) if name.startswith("posse_")}
    assert declared == {kind.hook for kind in KINDS.values()} | OBSERVERS


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_what_a_kind_names_exists_and_is_public(kind) -> None:
    asked = [kind.interface, *(c.interface for c in kind.capabilities.values() if c.interface)]
    if kind.conformance is not None:
        asked.append(kind.conformance)
    for target in asked:
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


def test_the_reserved_names_are_what_the_official_plugins_bring() -> None:
    for status in load_plugins().statuses:
        if status.dist in RESERVED:
            names = RESERVED[status.dist]
            reserved = {f"{kind}:{name}" for kind in names for name in names[kind] if kind != "plugin"}
            assert set(status.components) == reserved
            assert names["plugin"] == (status.name,)


def test_the_kit_refuses_a_capability_that_the_kind_does_not_have() -> None:
    class Misspelt(PropagatorConformance):
        capabilities = frozenset({"own-frame"})

    with pytest.raises(AssertionError, match="did you mean 'own-frames'"):
        Misspelt().test_the_capabilities_are_known()
    PropagatorConformance().test_the_capabilities_are_known()
