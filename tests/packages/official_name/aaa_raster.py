"""Its distribution is sorted before all others, and its renderer has the name of an official one."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("raster", "another's name", "aaa_raster:Nothing")]
