"""Written for interfaces that this core does not have."""

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_renderers():
    return [ComponentSpec("future", "of another API", "posse_other_api:Nothing", api=99)]
