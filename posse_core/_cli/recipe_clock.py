"""The line of ``posse recipe`` and ``posse adapt`` on a terminal.

It has the step and, where steps are expected to take a known time, the share of it and the expected end.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import click
from tqdm import tqdm

from posse_core._cli.progress import Item

_EVERY_S = 1.0


class Clock:
    """Shows how far a recipe is, as :class:`posse_core._recipe.steps.Show` says.

    Attributes:
        share: 0 … 1 of the time of all steps that has passed, None where nothing is expected of them.
        left_s: until the expected end.
    """

    def __init__(self, command: str, line: tqdm[Any]) -> None:
        self._command, self._line = command, line
        self._expected_s: Mapping[str, float] = {}
        self._step = ""
        self._begun = time.monotonic()

    def begin(self, step: str) -> None:
        self._step, self._begun = step, time.monotonic()
        self.refresh()

    def expect(self, seconds: Mapping[str, float]) -> None:
        self._expected_s = seconds
        self.refresh()

    def bar(self, items: Iterable[Item], total: int, title: str) -> Iterable[Item]:
        return tqdm(items, title, total, leave=False, unit="frame", disable=None)

    def say(self, line: str) -> None:
        with tqdm.external_write_mode(file=sys.stderr):
            click.echo(line)

    def left_s(self, now: float) -> float | None:
        """Time until the expected end, at a time of ``time.monotonic``; None where it is not known."""
        if self._step not in self._expected_s:
            return None
        steps = list(self._expected_s)
        later_s = sum(self._expected_s[step] for step in steps[steps.index(self._step) + 1 :])
        return later_s + max(self._expected_s[self._step] - (now - self._begun), 0.0)

    def refresh(self) -> None:
        """Show the line as it is now."""
        words = [self._command, *filter(None, [self._step])]
        left_s = self.left_s(time.monotonic())
        if left_s is not None:
            total_s = sum(self._expected_s.values())
            self._line.n = round(100 * (1 - left_s / total_s))
            words.append(time.strftime("expected end %a %H:%M", time.localtime(time.time() + left_s)))
        self._line.set_description_str(", ".join(words), refresh=False)
        self._line.refresh()


@contextlib.contextmanager
def clock(command: str) -> Iterator[Clock]:
    """A line on a terminal that moves with the time; in a log or a pipe it is silent."""
    with tqdm(
        total=100,
        bar_format="{desc} {percentage:3.0f}%|{bar}|",
        position=0,
        leave=False,
        disable=None,
    ) as line:
        shown = Clock(command, line)
        ended = threading.Event()

        def tick() -> None:
            while not ended.wait(_EVERY_S):
                shown.refresh()

        ticking = threading.Thread(target=tick, daemon=True)
        if not line.disable:
            ticking.start()
        try:
            yield shown
        finally:
            ended.set()
            if ticking.is_alive():
                ticking.join()
