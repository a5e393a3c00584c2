"""The base of the conformance classes, which makes sure that no test is left out silently."""

from __future__ import annotations

from typing import Any

from posse_core._plugins.kinds import KINDS, Kind, import_target

CHANGED = "it is not as it was before the call: the component changed what it was given; copy it first"
"""What the tests of several kinds say of an array that a component must leave alone."""


def left_out(test_class: type) -> list[str]:
    """Tests of this package that ``test_class`` overrides without declaring them as expected failures.

    They are declared by ``pytest.mark.xfail(strict=True, reason="...")``. The failure is then reported,
    and so is the first time that the test passes.
    """
    found = []
    for base in test_class.__mro__:
        if base.__module__.startswith("posse_core.testing."):
            for name in (name for name in vars(base) if name.startswith("test_")):
                mine = getattr(test_class, name)
                marks = getattr(mine, "pytestmark", [])
                if mine is not vars(base)[name] and not any(map(_is_expected_failure, marks)):
                    found.append(name)
    return sorted(found)


def _is_expected_failure(mark: Any) -> bool:
    return bool(mark.name == "xfail" and mark.kwargs.get("strict") and mark.kwargs.get("reason"))


def _kind_of(test_class: type) -> Kind:
    """The kind whose conformance class ``test_class`` derives from."""
    for kind in KINDS.values():
        if issubclass(test_class, import_target(kind.conformance)):
            return kind
    raise TypeError(f"{test_class.__name__} derives from no conformance class of posse_core.testing")


class Conformance:
    """Base of the conformance classes.

    Attributes:
        capabilities: the capabilities of the component; some of them enable further tests.
    """

    capabilities: frozenset[str] = frozenset()

    def test_the_capabilities_are_known(self) -> None:
        """A misspelt capability would leave out the tests that it enables."""
        fault = _kind_of(type(self)).unknown_capability(self.capabilities)
        assert fault is None, fault

    def test_no_test_is_left_out(self) -> None:
        names = left_out(type(self))
        assert not names, (
            f"{', '.join(names)}: mark the override with pytest.mark.xfail(strict=True, reason='...')"
        )
