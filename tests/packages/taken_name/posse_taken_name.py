"""Its propagator has the name of one of the core's; its renderer's name is free, but goes with it."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("free", "goes with the rest", "posse_taken_name:Nothing")]


@hookimpl
def posse_propagators():
    return [ComponentSpec("roe", "a name that is taken", "posse_taken_name:Nothing")]
