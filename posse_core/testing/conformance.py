"""What the conformance classes share: no test of theirs is left out without a word."""

from __future__ import annotations

from typing import Any

from posse_core._plugins.kinds import KINDS, Kind, import_target


def left_out(test_class: type) -> list[str]:
    """Tests of this package that ``test_class`` replaces without owning up to a failure.

    A replacement is owned up to by ``pytest.mark.xfail(strict=True, reason="...")``: the failure is
    then in the report, and so is the day when the test comes to pass.
    """
    found = []
    for base in test_class.__mro__:
        if base.__module__.startswith("posse_core.testing."):
            for name in (name for name in vars(base) if name.startswith("test_")):
                mine = getattr(test_class, name)
                marks = getattr(mine, "pytestmark", [])
                if mine is not vars(base)[name] and not any(map(_is_owned_up, marks)):
                    found.append(name)
    return sorted(found)


def _is_owned_up(mark: Any) -> bool:
    return bool(mark.name == "xfail" and mark.kwargs.get("strict") and mark.kwargs.get("reason"))


def _kind_of(test_class: type) -> Kind:
    """The kind whose conformance class ``test_class`` derives from."""
    for kind in KINDS.values():
        if kind.conformance is not None and issubclass(test_class, import_target(kind.conformance)):
            return kind
    raise TypeError(f"{test_class.__name__} derives from no conformance class of posse_core.testing")


class Conformance:
    """Base of the conformance classes.

    Attributes:
        capabilities: those of the component's record; some call for more tests.
    """

    capabilities: frozenset[str] = frozenset()

    def test_the_capabilities_are_known(self) -> None:
        """A misspelt one would leave out the tests that it calls for."""
        fault = _kind_of(type(self)).unknown_capability(self.capabilities)
        assert fault is None, fault

    def test_no_test_is_left_out(self) -> None:
        names = left_out(type(self))
        assert not names, (
            f"{', '.join(names)}: mark the override with pytest.mark.xfail(strict=True, reason='...')"
        )
