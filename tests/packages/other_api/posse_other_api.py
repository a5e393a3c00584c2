"""Written for interfaces that this core does not have."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("future", "of another API", "posse_other_api:Nothing", api=99)]
