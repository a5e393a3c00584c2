"""Its entry point has the name of posse-plain's."""

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_renderers():
    return [ComponentSpec("second", "never listed", "posse_same_entry:Nothing")]
