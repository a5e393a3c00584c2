"""Its hook is not marked."""

from posse_core import ComponentSpec


def posse_renderers():
    return [ComponentSpec("unseen", "never listed", "posse_unmarked:Nothing")]
