"""A hook that there is not."""

from posse_core import hookimpl


@hookimpl
def posse_renderer():
    return []
