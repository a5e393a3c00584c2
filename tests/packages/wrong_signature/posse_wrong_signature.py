"""Its hook wants an argument that the hook does not have."""

from posse_core import hookimpl


@hookimpl
def posse_renderers(scene):
    return []
