"""A hook that there is not."""

from posse_core._plugins.hooks import hookimpl


@hookimpl
def posse_renderer():
    return []
