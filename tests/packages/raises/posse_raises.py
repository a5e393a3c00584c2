"""Its hook raises."""

from posse_core import hookimpl


@hookimpl
def posse_writers():
    raise RuntimeError("no luck")
