"""Its hook wants an argument that the hook does not have."""

from posse_core._plugins.hooks import hookimpl


@hookimpl
def posse_renderers(scene):
    return []
