"""The steps of a recipe: each is done once, from what it was begun with, however often it is stopped.

A step is done when its last file is there. What a step was begun with is noted before it begins; where a
step that is there was begun with something else, the recipe was changed in between, and that is refused
in place of mixing two recipes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeVar

from pydantic import JsonValue

from posse_core._errors import InputError
from posse_core._files.atomic import write_json
from posse_core._files.reading import FileRecord, read_record

NOTES: Final = "steps.json"


Item = TypeVar("Item")


class Show(Protocol):
    """Shows how far a recipe is."""

    def begin(self, step: str) -> None:
        """A step begins."""

    def expect(self, seconds: Mapping[str, float]) -> None:
        """Each step is expected to take so long."""

    def bar(self, items: Iterable[Item], total: int, title: str) -> Iterable[Item]:
        """Yield items, and show how many of ``total`` have been dealt with."""

    def say(self, line: str) -> None:
        """A step has ended, with this result."""


class Note(FileRecord):
    """What is known of a step.

    Attributes:
        of: name of what the step depends on → its value.
        seconds: that its attempts took which were not stopped.
    """

    of: dict[str, JsonValue]
    seconds: float = 0.0


class _Notes(FileRecord):
    steps: dict[str, Note]


@dataclass(frozen=True)
class Steps:
    """The steps in a recipe's folder."""

    folder: Path
    show: Show

    def do(
        self, name: str, of: Mapping[str, JsonValue], made: str, last: str, make: Callable[[], None]
    ) -> None:
        """Do a step, unless it is done.

        Args:
            name: of the step.
            of: what it depends on, by names for messages.
            made: the file or folder that it makes, from the recipe's folder; all else is within.
            last: the file that is there only when it is done.
            make: does it; it goes on with what an attempt that was stopped has left.

        Raises:
            InputError: what is there was begun with something else.
        """
        known = self.begun(name, made)
        if known is not None:
            for key in [*of, *known.of]:
                if of.get(key) != known.of.get(key):
                    raise InputError(
                        f"{self.folder / made}: was made with {_change(key, known.of, of)}; remove it to"
                        " make it again, or choose another folder"
                    )
        if (self.folder / last).exists():
            return
        self.show.begin(name)
        self._note(name, Note(of=dict(of), seconds=0.0 if known is None else known.seconds))
        started = time.monotonic()
        make()
        spent_s = self.notes()[name].seconds + time.monotonic() - started
        self._note(name, Note(of=dict(of), seconds=round(spent_s, 3)))

    def begun(self, name: str, made: str) -> Note | None:
        """What a step was begun with whose file or folder is there; None where it is not."""
        return self.notes().get(name) if (self.folder / made).exists() else None

    def notes(self) -> dict[str, Note]:
        """What is known of each step that was begun."""
        path = self.folder / NOTES
        if not path.exists():
            return {}
        return read_record(path, _Notes, "the notes of a recipe's steps").steps

    def _note(self, name: str, note: Note) -> None:
        all_notes = {**self.notes(), name: note}
        write_json(self.folder / NOTES, _Notes(steps=all_notes).model_dump(mode="json"))


def _change(key: str, before: Mapping[str, JsonValue], now: Mapping[str, JsonValue]) -> str:
    """``data.seed 1, which is now 2``; of nested keys the first that differs."""
    old, new = before.get(key), now.get(key)
    while isinstance(old, dict) and isinstance(new, dict):
        inner = next(k for k in [*new, *old] if old.get(k) != new.get(k))
        key, old, new = f"{key}.{inner}", old.get(inner), new.get(inner)
    return f"{key} {_short(old)}, which is now {_short(new)}"


def _short(value: JsonValue) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
