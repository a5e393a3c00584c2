"""Its hook raises."""

from posse_core._plugins.hooks import hookimpl


@hookimpl
def posse_writers():
    raise RuntimeError("no luck")
