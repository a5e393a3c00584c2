"""Progress on a terminal: phases that take seconds, and bars over what can be counted.

Both are written to stderr, and only if it is a terminal, so that logs and pipes stay clean.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from tqdm import tqdm

Item = TypeVar("Item")


@contextlib.contextmanager
def phase(words: str) -> Iterator[None]:
    """Say what is being done within the block, such as "opening the models"."""
    with tqdm(desc=words, bar_format="{desc} ...", leave=False, disable=None):
        yield


@contextlib.contextmanager
def phase_before_bar(words: str) -> Iterator[Callable[..., Iterator[Any]]]:
    """A :func:`phase` until a bar begins within the block, by the :func:`bar` that this gives."""
    with contextlib.ExitStack() as said:
        said.enter_context(phase(words))

        def shown(*arguments: Any, **options: Any) -> Iterator[Any]:
            said.close()
            return bar(*arguments, **options)

        yield shown


def bar(
    items: Iterable[Item],
    total: int,
    title: str = "",
    *,
    unit: str = "frame",
    done: int = 0,
    first: str = "",
    tell: Callable[[Item], str] | None = None,
) -> Iterator[Item]:
    """Yield items, and show how many have been dealt with.

    Args:
        items: whatever is counted.
        total: number of items, those that were done before included.
        title: stands before the bar.
        unit: what an item is.
        done: number of items that were done before.
        first: what happens until the first item comes, instead of the title.
        tell: what to say of the latest item, behind the bar.
    """
    with tqdm(
        total=total, initial=done, desc=first or title, unit=unit, smoothing=0.1, disable=None
    ) as shown:
        for number, item in enumerate(items):
            if number == 0 and first:
                shown.set_description(title, refresh=False)
            if tell is not None:
                shown.set_postfix_str(tell(item), refresh=False)
            yield item
            shown.update()
