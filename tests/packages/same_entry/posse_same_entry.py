"""Its entry point has the name of posse-plain's."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("second", "never listed", "posse_same_entry:Nothing")]
