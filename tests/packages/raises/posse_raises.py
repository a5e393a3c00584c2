"""Its hook raises."""

from posse_core.hookspecs import hookimpl


@hookimpl
def posse_writers():
    raise RuntimeError("no luck")
