"""Its renderer claims a capability that there is not."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    words = frozenset({"determinstic"})
    return [ComponentSpec("hasty", "its claim", "posse_misspelt_capability:Nothing", capabilities=words)]
