"""Written for the interfaces of an earlier core, which it says."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("earlier", "of another API", "posse_other_api:Nothing", api=1)]
